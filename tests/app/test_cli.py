"""The command line as scripts depend on it: names, options, what goes to which stream, exit codes."""

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from app_project import FRAMES
from data import CHECKOUT
from fake_project import CLICKED, click, contents
from gazeloc_app.cli import main
from tiny_arkitscenes import write_arkitscenes
from tiny_captures import write_scan

from gazeloc_core import __version__, pipeline
from gazeloc_core.frames.marks import FrameMark, FrameMarks, Mark
from gazeloc_core.methods import Method
from gazeloc_core.project import Project
from gazeloc_core.stages.registration import align_keypoints

OPTIONS = {
    "new": ["--scan", "--recording", "--colmap", "--truth", "--tag-family", "--tag-size"],
    "add": ["--recording", "--name", "--truth"],
    "run": ["--method", "--recording"],
    "view": ["--port"],
    "status": ["--json"],
    "evaluate": ["--truth", "--recording", "--without-bad", "--json"],
    "score": ["--method", "--recording", "--worst", "--json"],
    "protocol": ["--scan", "--every", "--share", "--seed", "--tag-family", "--tag-size"],
    "export": ["--format", "--output"],
    "tags": ["print", "--ids", "--size", "--output", "--family", "--paper"],
    "demo": ["--port"],
}
ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join([str(CHECKOUT / "app"), str(CHECKOUT)])}


def answer(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    """Run a command that must succeed; what it wrote to standard output."""
    capsys.readouterr()
    main([str(word) for word in words])
    return capsys.readouterr().out


def help_of(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    with pytest.raises(SystemExit) as stop:
        main([*words, "--help"])
    assert stop.value.code == 0
    return capsys.readouterr().out


def test_help_names_every_command(capsys):
    text = help_of(capsys)
    assert all(command in text for command in OPTIONS)
    assert __version__ in text


@pytest.mark.parametrize("command", OPTIONS)
def test_help_of_a_command_names_its_options(capsys, command: str):
    text = help_of(capsys, command)
    assert all(option in text for option in OPTIONS[command])
    assert ("PROJECT" in text) == (command not in ("demo", "tags"))


def test_help_draws_what_the_tag_size_is(capsys):
    text = help_of(capsys, "new")
    rows = [row.strip("│ ") for row in text.splitlines()]
    first = rows.index("tag36h11            tagStandard41h12")
    assert rows[first + 1 : first + 11] == [
        "# # # # # # # #     . . . . . . . . .",
        "# . . . . . . #     . # # # # # # # .",
        "# . . . . . . #     . #           # .",
        *["# . . . . . . #     . #   . . .   # ."] * 3,
        "# . . . . . . #     . #           # .",
        "# # # # # # # #     . # # # # # # # .",
        "<---- size --->     . . . . . . . . .",
        "<- size -->",
    ]


def test_tags_are_printed_with_what_their_size_is(capsys, tmp_path: Path):
    words = ["--ids", "0-9", "--size", "0.08", "--output", tmp_path / "tags.pdf", "--family", "tagStandard41h12"]
    for _ in range(2):  # its own file is replaced
        said = answer(capsys, "tags", "print", *words)
    assert "10 tags on 10 pages of a4. 80 mm is the inner edge" in said
    assert (tmp_path / "tags.pdf").read_bytes().startswith(b"%PDF-")


def test_version(capsys):
    assert answer(capsys, "--version") == f"gazeloc {__version__}\n"


def test_a_project_is_made_and_added_to(capsys, home: Path):
    words = ["new", home / "p", "--scan", home / "scan", "--recording", home / "walk", "--truth", home / "truth.tum"]
    said = answer(capsys, *words, "--tag-family", "tag36h11", "--tag-size", "0.16")
    assert "Recognised as 3D Scanner App" in said
    assert "Recognised as Pupil Cloud export" in said
    answer(capsys, "add", home / "p", "--recording", home / "pictures", "--name", "second walk")
    settings = Project.open(home / "p").settings
    assert settings.tags is not None
    assert (settings.tags.family, settings.tags.size_m) == ("tag36h11", 0.16)
    assert list(settings.recordings) == ["walk", "second walk"]
    assert settings.recordings["walk"].truth == home / "truth.tum"


def test_commands_leave_scan_and_recording_alone(capsys, home: Path):
    places = [home / name for name in ("scan", "walk", "pictures")]
    before = [contents(place) for place in places]
    answer(capsys, "new", home / "p", "--scan", home / "scan", "--recording", home / "walk")
    answer(capsys, "add", home / "p", "--recording", home / "pictures")
    answer(capsys, "status", home / "p")
    answer(capsys, "evaluate", home / "aligned")
    answer(capsys, "export", home / "aligned", "--format", "csv", "--output", home / "out")
    assert [contents(place) for place in places] == before


def test_status_is_one_json_object_and_changes_nothing(capsys, home: Path):
    before = contents(home)
    value = json.loads(answer(capsys, "status", home / "project", "--json"))
    assert value["project"] == str(home / "project")
    assert [(stage["stage"], stage["state"]) for stage in value["stages"]] == [
        ("keyframes", "fresh"),
        ("undistorted", "fresh"),
        ("reconstruction", "fresh"),
        ("tracking", "missing"),
        ("alignment", "missing"),
        ("refinement", "missing"),
        ("pieces", "missing"),
        ("trajectory", "missing"),
        ("gaze", "missing"),
    ]
    assert contents(home) == before


def test_what_becomes_of_frames_between_keyframes_is_kept_with_the_project(capsys, home: Path):
    project = Project.open(home / "project")
    for between, stages in (("interpolate", 0), ("track", 1)):
        with pytest.raises(SystemExit):  # the alignment fails for want of keypoints
            main(["run", str(home / "project"), "--between", between])
        assert project.settings.track_frames is (between == "track")
        value = json.loads(answer(capsys, "status", home / "project", "--json"))
        assert [stage["stage"] for stage in value["stages"]].count("tracking") == stages


def test_evaluate_is_one_json_object(capsys, home: Path):
    value = json.loads(answer(capsys, "evaluate", home / "aligned", "--json"))
    found = value["walk"]["sfm"]
    assert (found["frames"], found["keyframes"], found["registered"]) == (12, 2, 2)
    for name, limit in (("rotation_deg", 1e-3), ("position_m", 1e-4)):
        assert set(found[name]) == {"mean", "median", "p75", "p90", "p95", "max"}
        assert all(0 <= number < limit for number in found[name].values())


def test_evaluate_prints_errors_and_then_errors_along_the_path(capsys, home: Path):
    first, second, third = answer(capsys, "evaluate", home / "aligned").split("\n\n")
    head, _, row = first.splitlines()
    assert row.split()[:5] == ["walk", "sfm", "12", "2", "2"]
    assert len(head.split()) == 5 + 2 * 8  # each of the eight statistics has its unit beside it
    head, _, row = second.splitlines()
    assert "ATE cm" in head
    assert "after Sim3" in head
    assert row.split()[2:5] == ["0", "of", "2"]
    assert row.split()[5:] == ["0.00", "–", "–", "0.00", "0.00", "–", "–"]  # two poses tell nothing after an alignment
    assert [row.split()[:4] for row in third.splitlines()[2:]] == [
        ["walk", "sfm", "registered", "2"],
        ["walk", "sfm", "interpolated", "5"],
    ]


def test_evaluate_leaves_out_what_people_marked_bad(capsys, project: Project):
    align_keypoints(project, "walk")
    pipeline.run_after_choice(project, "walk", Method.SFM)
    assert "bad" not in answer(capsys, "evaluate", project.folder)
    project.save_marks("walk", FrameMarks().put(FrameMark(4, Mark.BAD)).put(FrameMark(5, Mark.GOOD)))
    words = ["evaluate", project.folder, "--without-bad"]
    said = answer(capsys, *words)
    assert "walk, sfm: left out are 1 marked bad" in said
    rows = [line.split() for line in said.splitlines()]
    assert [row[2:4] for row in rows if row[2:3] in (["bad"], ["good"])] == [["good", "1"], ["bad", "1"]]
    found = json.loads(answer(capsys, *words, "--json"))["walk"]["sfm"]
    assert (found["left_out"], found["keyframes"]) == (1, 7)
    assert "left out" not in answer(capsys, "evaluate", project.folder)


def test_evaluate_takes_a_truth_of_its_own(capsys, home: Path):
    shifted = []
    for line in (home / "truth.tum").read_text().splitlines():
        if not line.startswith("#"):
            time_s, x, rest = line.split(maxsplit=2)
            shifted.append(f"{time_s} {float(x) + 1} {rest}")
    (home / "shifted.tum").write_text("\n".join(shifted))
    words = ["evaluate", home / "aligned", "--truth", home / "shifted.tum", "--recording", "walk", "--json"]
    value = json.loads(answer(capsys, *words))
    assert value["walk"]["sfm"]["position_m"]["mean"] == pytest.approx(1.0, abs=1e-4)


def test_score_lists_the_frames_that_agree_least(capsys, project: Project):
    align_keypoints(project, "walk")
    project.save_marks("walk", FrameMarks().put(FrameMark(3, Mark.BAD, "too far left")))
    value = json.loads(answer(capsys, "score", project.folder, "--json", "--worst", 99))["walk"]["sfm"]
    scores = pipeline.score(project, "walk")
    assert (value["frames"], value["with_a_pose"], value["scored"]) == (FRAMES, 15, 15)
    assert value["median"] == np.nanmedian(scores.score)
    assert [row["frame_index"] for row in value["worst"]] == np.argsort(scores.score)[:15].tolist()
    summary, worst = answer(capsys, "score", project.folder, "--worst", 15).split("\n\n")
    assert summary.splitlines()[2].split()[:5] == ["walk", "sfm", str(FRAMES), "15", "15"]
    rows = {row.split()[0]: row.split(maxsplit=10) for row in worst.splitlines()[3:]}
    assert len(rows) == 15
    assert rows["3"][8:] == ["registered" if 3 % 2 == 0 else "interpolated", "bad", "too far left"]
    assert float(rows["3"][2]) == pytest.approx(scores.score[3], abs=0.005)
    assert float(rows["3"][3]) == pytest.approx(100 * scores.shift_m[3], abs=0.05)
    assert value["worst"][0]["score"] == np.nanmin(scores.score)
    assert "agree least" not in answer(capsys, "score", project.folder, "--worst", 0)


def test_an_arkitscenes_video_can_be_the_scan(capsys, home: Path):
    write_arkitscenes(home / "video")
    said = answer(capsys, "new", home / "p", "--scan", home / "video", "--recording", home / "walk")
    assert "Recognised as ARKitScenes: it holds" in said
    assert "4 of the 8 pictures in lowres_wide have a pose" in said
    assert Project.open(home / "p").settings.scan.path == home / "video"


def test_protocol_makes_a_project_that_is_ready_to_run(capsys, home: Path):
    write_scan(home / "long", frames=8)
    said = answer(capsys, "protocol", home / "p", "--scan", home / "long", "--tag-family", "tag36h11")
    assert "Recognised as image folder: it holds 4 images and camera.json" in said
    assert f"Next: gazeloc run {home / 'p'}; gazeloc evaluate {home / 'p'}" in said
    states = json.loads(answer(capsys, "status", home / "p", "--json"))["stages"]
    assert {stage["state"] for stage in states} == {"missing"}
    settings = Project.open(home / "p").settings
    assert settings.tags is not None
    assert settings.recordings["held-out"].truth == home / "p" / "held_out" / "truth.tum"


@pytest.mark.parametrize(
    ("form", "names"),
    [
        ("csv", ["poses.csv", "gaze3d.csv"]),
        ("tum", ["poses.tum"]),
        ("colmap", ["images.bin"]),
        ("nerfstudio", ["transforms.json"]),
    ],
)
def test_export_names_what_it_wrote(capsys, home: Path, form: str, names: list[str]):
    *files, reminder = answer(
        capsys, "export", home / "aligned", "--format", form, "--output", home / "out"
    ).splitlines()
    assert "show people" in reminder
    assert all(Path(file).is_file() for file in files)
    assert set(names) <= {Path(file).name for file in files}


def test_export_again_replaces_its_own_files(capsys, home: Path):
    words = ["export", home / "aligned", "--format", "csv", "--output", home / "out"]
    assert answer(capsys, *words) == answer(capsys, *words)


@pytest.mark.slow
def test_run_goes_from_keypoints_to_gaze_and_then_has_nothing_to_do(capsys, home: Path):
    project = Project.open(home / "project")
    click(project, CLICKED)
    said = answer(capsys, "run", project.folder, "--recording", "walk", "--method", "sfm")
    assert "Align to the scan" in said
    assert "walk: good: The keypoints fit" in said
    states = json.loads(answer(capsys, "status", project.folder, "--json"))["stages"]
    assert {stage["state"] for stage in states} == {"fresh"}
    before = contents(home)
    assert "Align to the scan" not in answer(capsys, "run", project.folder)
    assert contents(home) == before


def started(home: Path, *words: object, **options: Any) -> "subprocess.Popen[str]":
    command = [sys.executable, "-m", "gazeloc_app", *map(str, words)]
    return subprocess.Popen(command, text=True, env=ENVIRONMENT, cwd=home, **options)


@pytest.mark.slow
def test_ctrl_c_ends_a_run_quietly_and_keeps_what_was_done(home: Path):
    click(Project.open(home / "project"), CLICKED)
    for attempt in range(6):  # a quick machine may be done before the signal comes
        project = Project.open(Path(shutil.copytree(home / "project", home / f"project-{attempt}")))
        process = started(home, "run", project.folder, stderr=subprocess.PIPE, stdout=subprocess.PIPE)
        assert process.stderr is not None
        for line in process.stderr:
            if "Refine with ICP" in line:
                break
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
        if process.returncode != 0:
            break
    assert process.returncode == 130
    assert "Traceback" not in err
    assert err.splitlines()[-1] == "gazeloc: stopped; what was done stays."
    assert out == ""
    assert project.artifact("walk", "alignment").exists
    assert not project.artifact("walk", "refinement").exists
    assert not list(project.folder.rglob("*.part"))
    project.lock().release()


def test_a_reader_that_stops_reading_is_no_error(home: Path):
    reading, writing = os.pipe()
    os.close(reading)
    process = started(home, "status", home / "project", "--json", stdout=writing, stderr=subprocess.PIPE)
    os.close(writing)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 0
    assert err == ""


@pytest.mark.parametrize(
    ("words", "absent"),
    [
        (["--help"], {"open3d", "pycolmap", "trimesh", "viser", "scipy", "av"}),
        (["status", "project", "--jsn"], {"open3d", "pycolmap", "trimesh", "viser", "scipy", "av"}),
        (["status", "project"], {"open3d", "trimesh", "viser"}),
        (["evaluate", "aligned", "--json"], {"open3d", "trimesh", "viser"}),
    ],
)
def test_what_takes_long_to_import_is_not_imported_needlessly(home: Path, words: list[str], absent: set[str]):
    code = (
        "import sys\nfrom gazeloc_app.cli import main\n"
        "try:\n    main(sys.argv[1:])\nexcept SystemExit:\n    pass\n"
        "print(' '.join({name.split('.')[0] for name in sys.modules}))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *words], env=ENVIRONMENT, cwd=home, capture_output=True, text=True
    )
    imported = set(done.stdout.splitlines()[-1].split())
    assert "gazeloc_core" in imported
    assert not imported & absent


def test_advice_on_tags_is_a_table_of_shares(capsys, monkeypatch, tmp_path):
    from gazeloc_app import advice

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    small = advice.SafeRangeOptions
    monkeypatch.setattr(
        advice,
        "SafeRangeOptions",
        lambda **given: small(**(given | {"pixels": (33, 115), "angles_deg": (0, 40), "repeats": 2})),
    )
    said = answer(capsys, "advise", "--width", "3", "--length", "4", "--quick")
    rows = [line.split() for line in said.splitlines() if line.split() and line.split()[0].isdigit()]
    assert [int(row[0]) for row in rows] == [4, 6, 8, 10, 12, 16, 20, 24]
    shares = [[int(cell.rstrip("%")) for cell in row[1:]] for row in rows]
    assert all(0 <= share <= 100 for row in shares for share in row)
    assert shares[-1][-1] >= shares[0][0], "more and larger tags are seen more often"
