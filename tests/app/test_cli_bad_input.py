"""Whatever is wrong with what a user names: exit code 2, one sentence on standard error, and nothing is changed."""

import json
import re
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bad_input import change_json, cut, into_folder, remove, write
from fake_project import CLICKED, click, contents
from gazeloc_app.cli import main

from gazeloc_core.methods import Method
from gazeloc_core.pipeline import run_stage, stage_named
from gazeloc_core.project import Project
from gazeloc_core.stages import inputs
from gazeloc_core.stages.recording import reconstruction_inputs

Prepare = Callable[[Path], list[Any]]
CASES: list[Any] = []
SHEARED = [1, 0.2, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]


def case(name: str, sentence: str) -> Callable[[Prepare], Prepare]:
    """Add a case: what is wrong, and what the sentence must say of it."""

    def add(prepare: Prepare) -> Prepare:
        CASES.append(pytest.param(prepare, sentence, id=name))
        return prepare

    return add


def add(name: str, sentence: str, arguments: str, damage: Callable[[Path], Any] = lambda home: None) -> None:
    """Add a case whose words name files of `home`: `@walk` is home/walk, `@new` what a new project needs."""

    def prepare(home: Path) -> list[Any]:
        damage(home)
        text = arguments.replace("@new", "new @fresh --scan @scan --recording @walk")
        return [str(home / word[1:]) if word.startswith("@") else word for word in text.split()]

    case(name, sentence)(prepare)


def at(folder: str, damage: Callable[[Path], Any]) -> Callable[[Path], Any]:
    """The damage, done inside a folder of `home`."""
    return lambda home: damage(home / folder)


def keypoints(in_scan: np.ndarray, in_sfm: np.ndarray | None = None) -> Callable[[Path], Any]:
    return lambda home: click(Project.open(home / "project"), in_scan, in_sfm)


def annotation(text: str) -> Callable[[Path], Any]:
    def damage(home: Path) -> None:
        (home / "project" / "annotations").mkdir()
        (home / "project" / "annotations" / "walk.json").write_text(text)

    return damage


def setting(**values: Any) -> Callable[[Path], Any]:
    """Change values of project.json."""

    def damage(home: Path) -> None:
        path = home / "project" / "project.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | values))

    return damage


def first_lines(name: str, count: int) -> Callable[[Path], Any]:
    return lambda home: (home / name).write_text("".join((home / name).read_text().splitlines(True)[:count]))


def recorded_in(name: str) -> dict[str, Any]:
    entry = {"path": f"../{name}", "colmap": None, "colmap_times": None, "truth": None}
    return {"recordings": {"walk": entry}}


def theirs(name: str) -> Callable[[Path], Any]:
    """A file of another program in a folder of its own."""

    def damage(home: Path) -> None:
        (home / "theirs").mkdir()
        (home / "theirs" / name).write_text("theirs")

    return damage


def tum(line: str) -> Callable[[Path], Any]:
    return lambda home: (home / "bad.tum").write_text(line)


def first_frame(**values: Any) -> Callable[[Path], Any]:
    return at("scan", change_json("frame_00000.json", **values))


# The arguments themselves.
add("no command", r"Expected one of {new, add, run", "")
add("unknown command", r"nope.*; see `gazeloc --help`", "nope @project")
add("no project named", r"PROJECT.*; see `gazeloc status --help`", "status")
add("unknown flag", r"--jsn; see `gazeloc status --help`", "status @project --jsn")
add("flag without value", r"'--scan'; see `gazeloc new --help`", "new @fresh --recording @walk --scan")
add("word for a number", r"--tag-size big: this is not a number", "@new --tag-family tag36h11 --tag-size big")
add("tag size 0", r"--tag-size 0: a tag is between .* metres", "@new --tag-family tag36h11 --tag-size 0")
add("tag size below 0", r"--tag-size -0\.16: a tag is", "@new --tag-family tag36h11 --tag-size -0.16")
add("tag size in centimetres", r"--tag-size 16: .* give its size in metres", "@new --tag-family tag36h11 --tag-size 16")
add("tag size nan", r"--tag-size nan: a tag is", "@new --tag-family tag36h11 --tag-size nan")
add("tag size without family", r"--tag-size 0\.16 needs --tag-family too", "@new --tag-size 0.16")
add("unknown family", r"--tag-family tag99: no such family; choose one of tag", "@new --tag-family tag99")
add("family in another spelling", r"Tag36H11: no such family; choose one of", "@new --tag-family Tag36H11")
add("unknown unit", r"unit 'furlong' is unknown; use one of m, cm", "@new --unit furlong")
add("unknown up axis", r"up axis 'w' is unknown; use one of x, y", "@new --up w")
add("name that leads elsewhere", r"'\.\./up' cannot be used .*; use letters", "@new --name ../up")
add("COLMAP times without a model", r"truth\.tum: --colmap-times needs --colmap", "@new --colmap-times @truth.tum")
add(
    "name for an address",
    r"--host example\.org: .*not an address; give 127\.0\.0\.1",
    "view @project --host example.org",
)
add("empty address", r"--host : .*not an address", "view @project --host=")
add("URL for a host", r"--allow-host http://lab: give the bare name", "view @project --allow-host http://lab")
add("port out of range", r"Port 70000 .*0 to 65535.* choose another", "view @project --port 70000")

# The scan.
add("scan missing", r"attic: there is no such file or folder", "new @fresh --scan @attic --recording @walk")
add("scan is a recording", r"walk: no known kind of scan", "new @fresh --scan @walk --recording @walk")
add("mesh without unit", r"room\.obj: .* pass --unit", "new @fresh --scan @room.obj --recording @walk")
add(
    "mesh without triangles",
    r"empty\.obj: .*0 faces",
    "new @fresh --scan @empty.obj --recording @walk --unit m --up y",
    write("empty.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n"),
)
add(
    "mesh cut off",
    r"room\.obj: ",
    "new @fresh --scan @room.obj --recording @walk --unit m --up y",
    cut("room.obj", 0.3),
)
add(
    "mesh without frames, but tags",
    r"room\.obj: .*no frames with pictures.*; leave --tag-family out",
    "new @fresh --scan @room.obj --recording @walk --unit m --up y --tag-family tag36h11",
)
add(
    "pose that is sheared",
    r"frame_00000\.json: .*(rotation|orthonormal)",
    "@new",
    first_frame(cameraPoseARFrame=SHEARED),
)
add("pose with too few numbers", r"frame_00000\.json: .*15 numbers", "@new", first_frame(cameraPoseARFrame=SHEARED[1:]))
add("pose that is NaN", r"frame_00000\.json: .*not finite", "@new", first_frame(cameraPoseARFrame=[float("nan")] * 16))
add("frame cut off", r"frame_00001\.json: .*not valid JSON", "@new", at("scan", cut("frame_00001.json", 0.5)))

# The recording.
add("recording missing", r"attic: there is no such", "new @fresh --scan @scan --recording @attic")
add("recording is a scan", r"scan: no known kind of recording", "new @fresh --scan @scan --recording @scan")
add("video missing", r"walk: .*(video|mp4)", "@new", at("walk", remove("*.mp4")))
add("video cut off", r"\.mp4: ", "@new", at("walk", cut("*.mp4", 0.5)))
add("times missing", r"walk: no known kind of recording", "@new", at("walk", remove("world_timestamps.csv")))
add("far fewer times than frames", r"walk.*: .*12 .*3", "@new", first_lines("walk/world_timestamps.csv", 4))
add(
    "camera missing",
    r"scene_camera\.json: .*calibration is missing; export it",
    "@new",
    at("walk", remove("scene_camera.json")),
)
add(
    "camera is a folder",
    r"scene_camera\.json: .*calibration is missing",
    "@new",
    at("walk", into_folder("scene_camera.json")),
)
add("gaze without columns", r"gaze\.csv: the column .* is missing", "@new", at("walk", write("gaze.csv", "a,b\n1,2\n")))

# COLMAP models and truth.
add("model missing", r"attic: there is no such folder", "@new --colmap @attic")
add("model damaged", r"images\.txt: ", "@new --colmap @colmap", at("colmap", cut("images.txt", 0.6)))
add("model of another camera", r"colmap: .*camera 1", "@new --colmap @colmap")
add("truth missing", r"attic\.tum: the file is missing", "@new --truth @attic.tum")
add("truth garbled", r"bad\.tum: line 1 holds something", "@new --truth @bad.tum", tum("0 a b c 0 0 0 1\n"))
add("truth with NaN", r"bad\.tum: line 1 .*not finite", "@new --truth @bad.tum", tum("0 nan 0 0 0 0 0 1\n"))
add("truth not unit", r"bad\.tum: line 1 .*length 2;", "@new --truth @bad.tum", tum("0 0 0 0 0 0 0 2\n"))
add("truth with two numbers", r"bad\.tum: line 1 has 2 values", "@new --truth @bad.tum", tum("0 1\n"))
add("truth empty", r"bad\.tum: the file holds no poses", "@new --truth @bad.tum", tum("# none\n"))

# The project folder.
add("a project is there", r"project: there is a project already", "new @project --scan @scan --recording @walk")
add("the folder is not empty", r"walk: the folder is not empty", "new @walk --scan @scan --recording @walk")
add("the folder is a file", r"truth\.tum: ", "new @truth.tum --scan @scan --recording @walk")
add("the folder is below a file", r"truth\.tum.p: .*another", "new @truth.tum/p --scan @scan --recording @walk")
for words in ("add @scan --recording @walk", "run @scan", "view @scan", "status @scan", "evaluate @scan"):
    add(f"{words.split()[0]}: not a project", r"scan: there is no project\.json; make", words)
add("export: not a project", r"scan: there is no project\.json", "export @scan --format csv --output @out")
add(
    "project of another version",
    r"project\.json: written as .* version 99.*update gazeloc",
    "run @project",
    setting(version=99),
)
add("project cut off", r"project\.json: .*not valid JSON", "status @project", at("project", cut("project.json", 0.7)))
add("project without its scan", r"project\.json: .*damaged .*; restore", "status @project --json", setting(scan=None))
add(
    "project with a number for a path",
    r"project\.json: .*damaged",
    "run @project",
    setting(recordings={"walk": {"path": 7}}),
)
add("recording of that name is there", r"'walk'; choose another with --name", "add @project --recording @walk")
add("added recording missing", r"attic: there is no such", "add @project --recording @attic")

# The paper's protocol.
add("protocol: scan missing", r"attic: there is no such file", "protocol @fresh --scan @attic")
add("protocol: a bare mesh", r"room\.obj: .* pass --unit", "protocol @fresh --scan @room.obj")
add("protocol: too few frames", r"scan: of its 4 posed frames .* 2 would be held out", "protocol @fresh --scan @scan")
add("protocol: every frame", r"Every 1 frames cannot be held out; hold", "protocol @fresh --scan @scan --every 1")
add("protocol: more than all", r"share to hold out is 1\.5; it must", "protocol @fresh --scan @scan --share 1.5")
add("protocol: word for a number", r"--every two: this is not a number", "protocol @fresh --scan @scan --every two")
add("protocol: folder in use", r"walk: the folder is not empty; name", "protocol @walk --scan @scan")
add("protocol: unknown family", r"--tag-family x: no such family", "protocol @fresh --scan @scan --tag-family x")

# Running.
add("unknown method", r"no method 'slam'; the methods are: sfm", "run @project --method slam")
add("run: unknown recording", r"no recording 'run'; the project has walk", "run @project --recording run")
add("scan gone since", r"room\.obj", "run @project", lambda home: (home / "room.obj").unlink())
add("recording gone since", r"attic", "run @project", setting(**recorded_in("attic")))
add("no keypoint", r"walk: there is no keypoint yet; click at least three", "run @project")
add("two keypoints", r"walk: There are 2 keypoint pairs.* three", "run @project", keypoints(CLICKED[:2]))
add("keypoints at one place", r"walk: .* at 1 different places", "run @project", keypoints(CLICKED[[0, 0, 0, 0]]))
add(
    "keypoints on one line",
    r"walk: The 4 keypoints .* lie on one line of the scan.*; add one",
    "run @project",
    keypoints(CLICKED[0] + np.outer([0, 1, 2.5, 4], [0.3, 0.1, -0.2])),
)
add(
    "mirrored keypoints",
    r"walk: The keypoints fit a mirror image.*; check the pairs",
    "run @project",
    keypoints(CLICKED, CLICKED * [-1, 1, 1]),
)
add("keypoints cut off", r"walk\.json: .*not valid JSON", "run @project", annotation('[{"key": "k1"'))
add(
    "keypoint not finite",
    r"keypoints are garbled .*; restore",
    "run @project",
    annotation('[{"key": "k1", "name": "a", "scan": [1, 2, NaN], "sfm": null, "sightings": [], "enabled": true}]'),
)
add(
    "result damaged",
    r"reconstruction: the arrays are damaged .*; remove it and run",
    "run @project",
    lambda home: (keypoints(CLICKED)(home), at("project/recordings/walk/reconstruction", cut("arrays.npz", 0.5))(home)),
)
add(
    "picture that does not decode",
    r"f_2\.jpg: .*",
    "run @project",
    lambda home: (setting(**recorded_in("pictures"))(home), at("pictures", write("f_2.jpg", b"no picture"))(home)),
)

# Results.
add("evaluate: before a run", r"walk: the poses .*|.* run `gazeloc run`", "evaluate @project")
add("evaluate: unknown recording", r"no recording 'run'; the project has walk", "evaluate @aligned --recording run")
add("evaluate: truth missing", r"attic\.tum: the file is missing", "evaluate @aligned --truth @attic.tum")
add(
    "evaluate: truth of another clock",
    r"bad\.tum: .*within 1 ms; ",
    "evaluate @aligned --json --truth @bad.tum",
    tum("12.5 0 0 0 0 0 0 1\n"),
)
add(
    "evaluate: no truth",
    r"no recording has a ground truth; give one with --truth",
    "evaluate @project",
    setting(**recorded_in("walk")),
)
add("export: before a run", r"walk: .*run `gazeloc run`", "export @project --format csv --output @out")
add("export: before a run, COLMAP", r"walk: .*run `gazeloc run`", "export @project --format colmap --output @out")
add(
    "export: unknown format",
    r"--format obj: no such format; choose one of csv, tum",
    "export @aligned --format obj --output @out",
)
add("export: unknown recording", r"no recording 'run'", "export @aligned --format csv --output @out --recording run")
for form in ("csv", "tum", "colmap", "nerfstudio"):
    add(f"export {form}: into a file", r"truth\.tum: ", f"export @aligned --format {form} --output @truth.tum")
    add(
        f"export {form}: below a file",
        r"truth\.tum.x: cannot be written",
        f"export @aligned --format {form} --output @truth.tum/x",
    )
for form, file in (
    ("csv", "poses.csv"),
    ("tum", "poses.tum"),
    ("colmap", "cameras.txt"),
    ("nerfstudio", "transforms.json"),
):
    add(
        f"export {form}: over another's file",
        r"theirs.*did not write",
        f"export @aligned --format {form} --output @theirs",
        theirs(file),
    )


def tagged(size_m: Any) -> Callable[[Path], Any]:
    """The project with the phone's scan, and with tags."""
    return setting(
        scan={"path": "../scan", "unit": None, "up_axis": None}, tags={"family": "tag36h11", "size_m": size_m}
    )


@case("no tag found", r"walk: no tag of .* tag36h11 .* show none.*; click")
def _(home: Path) -> list[Any]:
    tagged(0.16)(home)
    project = Project.open(home / "project")
    run_stage(project, stage_named("tags"), "walk")
    model = inputs.load_model(project, "walk")  # as it would be reconstructed of these frames without a tag
    project.artifact("walk", "reconstruction").write_arrays(
        inputs.model_arrays([model]), options={}, inputs=reconstruction_inputs(project, "walk")
    )
    return ["run", home / "project"]


add("project with a word for a tag size", r"project\.json: .*damaged .*'big'", "status @project", tagged("big"))
add(
    "recording whose name leads elsewhere",
    r"'\.\./up' cannot be used",
    "run @project",
    setting(recordings={"../up": {}}),
)
add("project with a bad tag size", r"tag size is -1", "run @project", tagged(-1))


@case("phone's picture that does not decode", r"frame_00002\.jpg: ")
def _(home: Path) -> list[Any]:
    tagged(None)(home)
    write("frame_00002.jpg", b"no picture")(home / "scan")
    return ["run", home / "project"]


@case("truth for one of two recordings", r"truth\.tum: the project has 2 recordings; say which one")
def _(home: Path) -> list[Any]:
    project = Project.open(home / "aligned")
    project.add_recording("again", project.recording("walk"))
    return ["evaluate", project.folder, "--truth", home / "truth.tum"]


@case(
    "results of an earlier alignment",
    r"walk: the poses of the method sfm are stale .*; run `gazeloc run --method sfm` first",
)
def _(home: Path) -> list[Any]:
    artifact = Project.open(home / "aligned").result("walk", Method.SFM, "trajectory")
    header = json.loads((artifact.folder / "header.json").read_text())
    header["inputs"]["alignment"] = "another"
    (artifact.folder / "header.json").write_text(json.dumps(header))
    return ["evaluate", home / "aligned"]


add("scores of a recording without poses", r"walk: no alignment is in force; run `gazeloc run`", "score @project")
add("scores by a method that is none", r"'sift'", "score @aligned --method sift")
add("scores of a recording that is none", r"'stroll'", "score @aligned --recording stroll")
add("fewer than no frames", r"--worst -1: this is how many frames to list", "score @aligned --worst=-1")
add("tags of no family", r"'tag36h10' is unknown", "tags print --ids 0 --size 0.1 --output @t.pdf --family tag36h10")
add("a tag that is not there", "its ids are 0 to 586", "tags print --ids 500-600 --size 0.1 --output @t.pdf")
add("ids that are none", "'0..3'; write them like", "tags print --ids 0..3 --size 0.1 --output @t.pdf")
add("tags larger than the paper", "a4 takes 0.16 m at most", "tags print --ids 0 --size 0.2 --output @t.pdf")
add("no such paper", "'a44' is unknown", "tags print --ids 0 --size 0.1 --output @t.pdf --paper a44")
add("tags over another's file", "GazeLoc did not write it", "tags print --ids 0 --size 0.1 --output @truth.tum")


def one_sentence(text: str) -> str:
    """The sentence at the end of what was written to standard error; all before it must be progress."""
    *progress, last = text.splitlines()
    assert all(re.match(r" *\d+% ", line) for line in progress), text
    assert last.startswith("gazeloc: ")
    assert last.endswith(".")
    assert not re.search(r"[.!?] [A-Z]", last), "more than one sentence"
    return last


@pytest.mark.parametrize(("prepare", "sentence"), CASES)
def test_it_is_one_sentence_and_changes_nothing(home: Path, capfd, prepare: Prepare, sentence: str):
    arguments = [str(word) for word in prepare(home)]
    before = contents(home)
    capfd.readouterr()
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    said = capfd.readouterr()
    assert stop.value.code == 2
    assert re.search(sentence, one_sentence(said.err))
    assert said.out == ""
    after = contents(home)
    assert before.items() <= after.items()
    assert after == before or arguments[0] in ("run", "score")  # what stages did before the one that failed stays
    assert not (home / "fresh").exists()


def test_there_are_at_least_forty_cases():
    assert len(CASES) >= 40


@pytest.fixture
def writer(home: Path) -> Iterator[None]:
    with Project.open(home / "project").lock():
        yield


@pytest.mark.usefixtures("writer")
@pytest.mark.parametrize("words", [["run"], ["add", "--recording", "walk", "--name", "b"], ["view", "--port", "0"]])
def test_a_second_writer_is_told_who_writes(home: Path, capfd, words: list[str]):
    before = contents(home)
    with pytest.raises(SystemExit) as stop:
        main([words[0], str(home / "project"), *(str(home / w) if w == "walk" else w for w in words[1:])])
    assert stop.value.code == 2
    sentence = one_sentence(capfd.readouterr().err)
    assert re.search(
        r"project: another process is writing to this project \(process \d+ on .* since [\d: -]{16}: .*\); close it",
        sentence,
    )
    assert contents(home) == before


def test_a_port_that_is_taken_is_refused(home: Path, capfd):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(SystemExit) as stop:
            main(["view", str(home / "project"), "--port", str(port)])
    assert stop.value.code == 2
    assert f"Port {port} cannot be used" in one_sentence(capfd.readouterr().err)
