"""Marks of frames: kept with their notes, one per frame, read back as they were, and carried into the exports."""

import json

import numpy as np
import pandas as pd
import pycolmap
import pytest
from app_project import make_app_project
from evo.tools import file_interface

from gazeloc_core.errors import InputError
from gazeloc_core.evaluation.truth import read_tum
from gazeloc_core.export.frame_notes import FrameNotes
from gazeloc_core.export.poses_csv import write_poses_csv
from gazeloc_core.frames.marks import MAX_NOTE, FrameMark, FrameMarks, Mark
from gazeloc_core.methods import Method
from gazeloc_core.pipeline import evaluate_recording, export, run_after_choice, score
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


@pytest.fixture
def project(tmp_path):
    project = make_app_project(tmp_path)
    align_keypoints(project, "walk")
    run_after_choice(project, "walk", Method.SFM)
    project.save_marks("walk", marked((4, Mark.BAD, NOTE)))
    return project


def test_marks_reach_the_exports(tmp_path, project):
    for format in ("csv", "nerfstudio"):
        export(project, format=format, output=tmp_path / format, recording="walk")
    table = pd.read_csv(tmp_path / "csv" / "poses.csv", dtype={"mark": str, "note": str}, keep_default_na=False)
    assert table.loc[table["mark"] != "", ["frame index", "mark", "note"]].values.tolist() == [[4, "bad", NOTE]]
    frames = json.loads((tmp_path / "nerfstudio" / "transforms.json").read_text())["frames"]
    assert [(f["frame_index"], f["mark"], f["note"]) for f in frames if "mark" in f] == [(4, "bad", NOTE)]


def test_readers_that_know_nothing_of_marks_still_read_the_files(tmp_path, project):
    plain, marked_up = tmp_path / "plain", tmp_path / "marked"
    for format in ("tum", "colmap"):
        export(project, format=format, output=marked_up / format, recording="walk")
    project.save_marks("walk", FrameMarks())
    export(project, format="tum", output=plain, recording="walk")
    text = (marked_up / "tum" / "poses.tum").read_text()
    assert f"# frame 4 is marked bad: {NOTE}\n" in text
    with_marks, without = (
        file_interface.read_tum_trajectory_file(str(path / "poses.tum")) for path in (marked_up / "tum", plain)
    )
    assert with_marks == without
    np.testing.assert_array_equal(read_tum(marked_up / "tum" / "poses.tum")[0], read_tum(plain / "poses.tum")[0])
    model = pycolmap.Reconstruction(str(marked_up / "colmap"))
    table = pd.read_csv(marked_up / "colmap" / "frames.csv", keep_default_na=False)
    assert sorted(table["image name"]) == sorted(image.name for image in model.images.values())
    assert table.loc[table["mark"] != "", ["frame index", "mark", "note"]].values.tolist() == [[4, "bad", NOTE]]


def test_the_agreement_is_exported_while_it_is_of_these_poses(tmp_path, project):
    found = score(project, "walk")
    scores = found.score
    for format in ("csv", "nerfstudio", "colmap"):
        export(project, format=format, output=tmp_path / format, recording="walk")
    table = pd.read_csv(tmp_path / "csv" / "poses.csv")
    for column, expected in (
        ("agreement", scores),
        ("shift [m]", found.shift_m),
        ("turn sigma [deg]", found.turn_sigma_deg),
    ):
        np.testing.assert_allclose(table[column], expected, atol=1e-4)
    frames = json.loads((tmp_path / "nerfstudio" / "transforms.json").read_text())["frames"]
    assert {f["frame_index"]: f["agreement"] for f in frames} == {
        f["frame_index"]: pytest.approx(scores[f["frame_index"]], abs=1e-4) for f in frames
    }
    table = pd.read_csv(tmp_path / "colmap" / "frames.csv")
    np.testing.assert_allclose(table["agreement"], scores[table["frame index"]], atol=1e-4)
    header = project.result("walk", Method.SFM, "scores").folder / "header.json"
    header.write_text(header.read_text().replace('"trajectory": "', '"trajectory": "another'))
    export(project, format="csv", output=tmp_path / "csv", recording="walk")
    assert pd.read_csv(tmp_path / "csv" / "poses.csv")["agreement"].isna().all()


def test_an_image_of_no_frame_has_no_notes():
    assert set(FrameNotes(marked((4, Mark.BAD, NOTE)), {"agreement": np.full(6, 0.5)}).cells(-1)) == {""}


def test_frames_marked_bad_can_be_left_out_of_an_evaluation(project):
    whole = evaluate_recording(project, "walk")
    without = evaluate_recording(project, "walk", without_bad=True)
    assert (whole.left_out, without.left_out) == (0, 1)
    assert 4 in whole.frame_index.tolist()
    assert without.frame_index.tolist() == [i for i in whole.frame_index.tolist() if i != 4]
    assert (whole.keyframes, without.keyframes) == (8, 7)
    expected = [whole.frame_position_m[whole.frame_index.tolist().index(4)]]
    for found in (whole, without):
        assert found.by_mark[Mark.BAD].frames == 1
        assert found.by_mark[Mark.BAD].position_m.mean == pytest.approx(expected[0])
        assert Mark.GOOD not in found.by_mark
    assert json.loads(json.dumps(without.to_json()))["by_mark"]["bad"]["frames"] == 1


def test_a_csv_of_an_earlier_version_is_replaced(tmp_path):
    path = tmp_path / "poses.csv"
    path.write_text("timestamp [ns],frame index,status,tx [m],ty [m],tz [m],qw,qx,qy,qz\n")
    project = make_app_project(tmp_path / "p")
    align_keypoints(project, "walk")
    run_after_choice(project, "walk", Method.SFM)
    write_poses_csv(fresh_trajectory(project, "walk"), path)
    assert len(pd.read_csv(path)) == 16
