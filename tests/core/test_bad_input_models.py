"""Bad COLMAP models and truth files, as a table."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bad_input import Act, Table, check_refused, into_folder, remove, write
from tiny_captures import write_colmap

from gazeloc_core.evaluation.truth import read_tum
from gazeloc_core.sfm.colmap_io import read_model

table = Table()
colmap = table.damaged("colmap", lambda path: write_colmap(path, "text"), read_model)
binary = table.damaged("colmap binary", write_colmap, read_model)


def tum(name: str, sentence: str, text: str) -> None:
    """Add a case that is a TUM file."""

    def prepare(tmp_path: Path) -> Act:
        (tmp_path / "truth.tum").write_text(text)
        return lambda: read_tum(tmp_path / "truth.tum")

    table.case(f"truth: {name}", sentence)(prepare)


def replace_text(name: str, old: str, new: str) -> Callable[[Path], Any]:
    def damage(folder: Path) -> None:
        text = (folder / name).read_text()
        assert old in text
        (folder / name).write_text(text.replace(old, new))

    return damage


def without_point_lines(folder: Path) -> None:
    lines = (folder / "images.txt").read_text().splitlines()
    (folder / "images.txt").write_text("\n".join(line for line in lines if line.endswith(".png")))


def one_pose(change: Callable[[list[str]], list[str]]) -> Callable[[Path], Any]:
    def damage(folder: Path) -> None:
        lines = (folder / "images.txt").read_text().splitlines()
        at = next(i for i, line in enumerate(lines) if line.endswith(".png"))
        lines[at] = " ".join(change(lines[at].split()))
        (folder / "images.txt").write_text("\n".join(lines))

    return damage


colmap("not a folder", r"there is no such folder", lambda p: shutil.rmtree(p))
colmap("folder without a model", r"there is no cameras\.bin or cameras\.txt", remove("cameras.txt"))
colmap("points missing", r"points3D\.txt: the file is missing", remove("points3D.txt"))
binary("images missing", r"images\.bin: the file is missing", remove("images.bin"))
colmap(
    "images is a folder",
    r"images\.txt: this is a folder",
    into_folder("images.txt"),
)
colmap(
    "images without their second lines",
    r"images\.txt: line 2 is not the list .* each image has two lines",
    without_point_lines,
)
colmap(
    "camera model unknown",
    r"cameras\.txt: camera 1: .*'FISH' is unknown",
    replace_text("cameras.txt", "SIMPLE_RADIAL", "FISH"),
)
colmap(
    "camera with too few parameters",
    r"camera 1: .*PINHOLE has 4 parameters, got 1",
    write("cameras.txt", "1 PINHOLE 64 64 9\n"),
)
colmap(
    "camera line cut off",
    r"cameras\.txt: line 1 is not `CAMERA_ID",
    write("cameras.txt", "1 PINHOLE\n"),
)
colmap(
    "camera id unknown",
    r"has camera 1, which is not in the cameras file",
    write("cameras.txt", "9 PINHOLE 64 64 9 9 32 32\n"),
)
colmap("no images", r"the model has no images", write("images.txt", "# none\n"))
colmap(
    "point line cut off",
    r"points3D\.txt: line \d+ is not `POINT3D_ID",
    write("points3D.txt", "1 2 3\n"),
)
colmap("points gone", r"an image sees point \d+, which is not in points3D", write("points3D.txt", ""))
colmap(
    "pose with NaN",
    r"image \S+\.png needs four finite quaternion values, got \[nan",
    one_pose(lambda w: [w[0], "nan", *w[2:]]),
)
colmap(
    "pose not of unit length",
    r"image \S+\.png has a quaternion of length 2",
    one_pose(lambda w: [w[0], "2", "0", "0", "0", *w[5:]]),
)
binary(
    "is text",
    r"cameras\.bin: the file announces \d+ records but is cut off",
    write("cameras.bin", "1 PINHOLE 64 64 9 9 32 32\n"),
)
binary(
    "camera model unknown",
    r"camera \d+ has the unknown model number 99",
    write("cameras.bin", np.array([1, 7 | 99 << 32, 64, 64], np.uint64).tobytes() + bytes(32)),
)
binary(
    "with a tail",
    r"points3D\.bin: 3 bytes follow the last record",
    lambda p: write("points3D.bin", (p / "points3D.bin").read_bytes() + b"abc")(p),
)

POSE = " 0 0 0 0 0 0 1\n"
tum("empty", r"truth\.tum: the file holds no poses", "# nothing\n")
tum("7 columns", r"line 2 has 7 values, expected 8", "1" + POSE + "2 0 0 0 0 0 1\n")
tum("words", r"line 1 holds something that is not a number", "1 a 0 0 0 0 0 1\n")
tum("NaN", r"line 2 holds a value that is not finite", "1" + POSE + "2 nan 0 0 0 0 0 1\n")
tum("time NaN", r"line 1 holds a value that is not finite", "nan" + POSE)
tum("quaternion of length 2", r"line 1 has a quaternion of length 2", "1 0 0 0 0 0 0 2\n")
tum("time falls", r"line 3: the time 1\.5 s does not rise", "1" + POSE + "2" + POSE + "1.5" + POSE)
tum("time twice", r"line 2: the time 1\.0 s does not rise", "1" + POSE + "1.0" + POSE)
tum("time in nanoseconds", r"line 1: the time 1650316509598345895 s is too large", "1650316509598345895" + POSE)


@pytest.mark.parametrize(("prepare", "sentence"), table.cases)
def test_bad_input_is_refused_with_one_sentence(tmp_path, prepare, sentence):
    check_refused(prepare(tmp_path), sentence)
