"""Marks of frames: kept with their notes, one per frame, read back as they were, and carried into the exports."""

import json

import pandas as pd
import pytest
from app_project import make_app_project

from gazeloc_core.errors import InputError
from gazeloc_core.export.poses_csv import write_poses_csv
from gazeloc_core.marks import MAX_NOTE, FrameMark, FrameMarks, Mark
from gazeloc_core.methods import Method
from gazeloc_core.pipeline import export, run_after_choice
from gazeloc_core.stages.poses import fresh_trajectory
from gazeloc_core.stages.registration import align_keypoints

NOTE = 'door, half "open" <b>'


def marked(*rows):
    marks = FrameMarks()
    for row in rows:
        marks = marks.put(FrameMark(*row))
    return marks


def test_a_frame_has_one_mark_and_marks_are_in_the_order_of_frames():
    marks = marked((9, Mark.GOOD), (2, Mark.BAD, "too  far\nleft"), (9, Mark.UNSURE))
    assert [(one.frame_index, one.mark, one.note) for one in marks.marks] == [
        (2, Mark.BAD, "too far left"),
        (9, Mark.UNSURE, ""),
    ]
    assert marks.counts() == {Mark.GOOD: 0, Mark.BAD: 1, Mark.UNSURE: 1}
    assert marks.remove(2).get(2) is None


def test_a_note_has_an_end():
    assert len(marked((0, Mark.BAD, "x" * 9999)).get(0).note) == MAX_NOTE


def test_marks_are_read_back_as_they_were(tmp_path):
    project = make_app_project(tmp_path)
    assert project.marks("walk") == FrameMarks()
    marks = marked((3, Mark.GOOD, NOTE), (5, Mark.UNSURE))
    project.save_marks("walk", marks)
    assert project.marks("walk") == marks
    project.save_marks("walk", FrameMarks())
    assert project.marks("walk") == FrameMarks()


@pytest.mark.parametrize(
    "value",
    [3, [3], [{"frame_index": 1}], [{"frame_index": 1, "mark": "fine", "note": ""}],
     [{"frame_index": -1, "mark": "good", "note": ""}], [{"frame_index": "1", "mark": "good", "note": ""}]],
)  # fmt: skip
def test_garbled_marks_are_refused_with_a_sentence(value):
    with pytest.raises(InputError, match="marks of frames are garbled"):
        FrameMarks.from_json(value)


def test_marks_reach_the_exports(tmp_path):
    project = make_app_project(tmp_path)
    align_keypoints(project, "walk")
    run_after_choice(project, "walk", Method.SFM)
    project.save_marks("walk", marked((4, Mark.BAD, NOTE)))
    for format in ("csv", "nerfstudio"):
        export(project, format=format, output=tmp_path / format, recording="walk")
    table = pd.read_csv(tmp_path / "csv" / "poses.csv", dtype={"mark": str, "note": str}, keep_default_na=False)
    assert table.loc[table["mark"] != "", ["frame index", "mark", "note"]].values.tolist() == [[4, "bad", NOTE]]
    frames = json.loads((tmp_path / "nerfstudio" / "transforms.json").read_text())["frames"]
    assert [(f["frame_index"], f["mark"], f["note"]) for f in frames if "mark" in f] == [(4, "bad", NOTE)]


def test_a_csv_of_an_earlier_version_is_replaced(tmp_path):
    path = tmp_path / "poses.csv"
    path.write_text("timestamp [ns],frame index,status,tx [m],ty [m],tz [m],qw,qx,qy,qz\n")
    project = make_app_project(tmp_path / "p")
    align_keypoints(project, "walk")
    run_after_choice(project, "walk", Method.SFM)
    write_poses_csv(fresh_trajectory(project, "walk"), path)
    assert len(pd.read_csv(path)) == 16
