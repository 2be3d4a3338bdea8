"""Bad scans, as a table: 3D Scanner App exports, meshes, and paths that are neither."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import trimesh
from bad_input import Act, Table, change_json, check_refused, cut, into_folder, remove, write
from tiny_arkitscenes import VIDEO, write_arkitscenes
from tiny_captures import BOX_FACES, CORNERS, picture, write_scan

from gazeloc_core.readers import open_scan

table = Table()
scan = table.damaged("scan", write_scan, open_scan)
video = table.damaged("video", lambda path: write_arkitscenes(path, raw=True), open_scan)
untextured = table.damaged("scan", lambda path: write_scan(path, textured=False), open_scan)


def mesh(name: str, sentence: str, write: Callable[[Path], Any], ending: str) -> None:
    """Add a case that is one mesh file."""

    def prepare(tmp_path: Path) -> Act:
        path = tmp_path / f"room.{ending}"
        write(path)
        kwargs = {} if ending == "glb" else {"unit": "m", "up_axis": "y"}
        return lambda: open_scan(path, **kwargs)

    table.case(f"mesh: {name}", sentence)(prepare)


def poses(change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Path], None]:
    """Damage the pose of the second frame."""

    def damage(folder: Path) -> None:
        file = folder / "frame_00001.json"
        pose = np.reshape(json.loads(file.read_text())["cameraPoseARFrame"], (4, 4))
        change_json(file.name, cameraPoseARFrame=change(pose).ravel().tolist())(folder)

    return damage


def sheared(pose: np.ndarray) -> np.ndarray:
    return pose @ np.array([[1, 0.2, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])


FRAME = "frame_00001.json"
scan("frame json cut off", rf"{FRAME}: the file is not valid JSON", cut(FRAME, 0.5))
scan("frame json empty", rf"{FRAME}: the file is not valid JSON", cut(FRAME, 0))
scan("frame json is a list", rf"{FRAME}: expected a JSON object, found list", write(FRAME, "[1]"))
scan("frame json in UTF-16", r"not UTF-8 text", write(FRAME, "{}", encoding="utf-16"))
scan("pose missing", r"'cameraPoseARFrame' is missing", change_json(FRAME, cameraPoseARFrame=None))
scan("pose of 12 numbers", r"holds 12 numbers, expected 16", change_json(FRAME, cameraPoseARFrame=[1] * 12))
scan("pose of words", r"does not hold numbers", change_json(FRAME, cameraPoseARFrame=["a"] * 16))
scan("pose with NaN", r"value that is not finite", poses(lambda m: m * np.nan))
scan("pose sheared", r"frame_00001\.json: cameraPoseARFrame is not a rotation", poses(sheared))
scan("pose scaled", r"is not a rotation", poses(lambda m: m @ np.diag([2, 2, 2, 1.0])))
scan("pose mirrored", r"mirrors space", poses(lambda m: m @ np.diag([-1, 1, 1, 1.0])))
scan("pose transposed", r"column-major", poses(lambda m: m.T))
scan(
    "focal length zero",
    r"focal length is \[0",
    change_json(FRAME, intrinsics=[0, 0, 1, 0, 9, 1, 0, 0, 1], projectionMatrix=None),
)
scan("projection zero", r"no sensible size", change_json(FRAME, projectionMatrix=[0] * 16))
scan("time missing", r"'time' is missing", change_json(FRAME, time=None))
scan("time does not rise", r"frame_00001\.json: its time does not rise", change_json(FRAME, time=402896.5))
scan("no mesh", r"there is no mesh", remove("textured_output.obj"))
scan(
    "mesh is a folder",
    r"there is no mesh",
    into_folder("textured_output.obj"),
)
scan(
    "texture cut off",
    r"textured_output\.jpg: the texture does not decode",
    cut("textured_output.jpg", 0.1),
)
scan("texture empty", r"textured_output\.jpg: the texture does not decode", cut("textured_output.jpg", 0))
scan(
    "picture is no picture",
    r"frame_00001\.jpg: the picture does not decode",
    write("frame_00001.jpg", b"x"),
)
scan("picture cropped", r"of another shape", lambda p: cv2.imwrite(str(p / "frame_00001.jpg"), picture(96, 48, 1)))
scan("depth cut off", r"depth_00001\.png: not a depth picture", cut("depth_00001.png", 0.3))
scan(
    "confidence of another size",
    r"not a confidence picture of the depth's size",
    lambda p: cv2.imwrite(str(p / "conf_00001.png"), np.ones((4, 4), np.uint8)),
)
scan("obj empty", r"textured_output\.obj: The mesh is empty", cut("textured_output.obj", 0))
scan(
    "obj without faces",
    r"The mesh is empty \(8 vertices, 0 faces\)",
    write("textured_output.obj", "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)),
)
untextured("picture cut off", r"frame_00002\.jpg: the picture does not decode", cut("frame_00002.jpg", 0.05))


TRAJ, AT = "lowres_wide.traj", f"{VIDEO}_305.477"
PINCAM, DEPTH, PLY = f"lowres_wide_intrinsics/{AT}.pincam", f"lowres_depth/{AT}.png", f"{VIDEO}_3dod_mesh.ply"
video("trajectory cut off", r"lowres_wide\.traj: line 3 has \d values, expected 7", cut(TRAJ, 0.6))
video("trajectory empty", r"lowres_wide\.traj: the file holds no poses", write(TRAJ, "\n"))
video("trajectory of words", r"line 1 holds something that is not a number", write(TRAJ, "a b c d e f g"))
video("trajectory with NaN", r"line 1 holds a value that is not finite", write(TRAJ, "305.377 0 0 nan 0 0 0"))
video("trajectory runs back", r"line 2: the time 304 s does not rise", write(TRAJ, "305 0 0 0 0 0 0\n304 0 0 0 0 0 0"))
video("trajectory is a picture", r"lowres_wide\.traj: the file is not UTF-8", write(TRAJ, b"\x89PNG\xff\xfe"))
video("trajectory of another video", r"none of the 8 pictures .* 1 poses; download", write(TRAJ, "9.1 0 0 0 0 0 0"))
video("intrinsics missing", rf"{AT}\.png: lowres_wide_intrinsics has no \.pincam", remove(PINCAM))
video("intrinsics cut off", r"expected the six numbers .*, found '256 192'", write(PINCAM, "256 192"))
video("intrinsics with focal length 0", r"\.pincam: .*focal length is \[0", write(PINCAM, "256 192 0 0 127 95"))
video("intrinsics with NaN", r"\.pincam: .*finite", write(PINCAM, "256 192 nan 210 127 95"))
video("intrinsics of size 0", r"\.pincam: The camera is 0x192 pixels", write(PINCAM, "0 192 210 210 127 95"))
video("intrinsics of infinite size", r"\.pincam: the size infx192 is not finite", write(PINCAM, "inf 192 2 2 127 95"))
video(
    "intrinsics of another shape", r"the picture is 256x192, of another shape", write(PINCAM, "640 640 500 500 320 320")
)
video("picture cut off", rf"{AT}\.png: the picture does not decode", cut(f"lowres_wide/{AT}.png", 0.001))
video("depth cut off", rf"{AT}\.png: not a depth picture", cut(DEPTH, 0.1))
video("no mesh", r"there are 0 meshes \*_3dod_mesh\.ply, expected 1", remove(PLY))
video("mesh cut off", rf"{PLY}: ", cut(PLY, 0.5))
video("mesh of another room", r"lidar depth and mesh disagree", lambda p: shifted(p / PLY))


def shifted(path: Path) -> None:
    mesh = trimesh.load_mesh(path, process=False)
    trimesh.Trimesh(np.add(mesh.vertices, (0.8, 0.5, 0.4)), mesh.faces).export(path)


@table.case("video: a unit of its own", r"ARKitScenes is in metres with z up; leave the unit")
def _(tmp_path: Path) -> Act:
    return lambda: open_scan(write_arkitscenes(tmp_path), unit="mm")


def obj(text: str) -> Callable[[Path], Any]:
    return lambda path: path.write_text(text)


TRIANGLE = "v 0 0 0\nv 1 0 0\nv 1 1 0\n"
mesh("obj line cut off", r"room\.obj: the line 'v 1 1' is not complete", obj("v 0 0 0\nv 1 0 0\nv 1 1\n"), "obj")
mesh("obj face cut off", r"the line 'f 1 2' is not complete", obj(TRIANGLE + "f 1 2\n"), "obj")
mesh(
    "obj face names no vertex",
    r"the line 'f 1 2 4' names what is not among the 3 vertices",
    obj(TRIANGLE + "f 1 2 4\n"),
    "obj",
)
mesh("obj with words", r"the line 'v 1 1 x' is not complete", obj("v 0 0 0\nv 1 0 0\nv 1 1 x\nf 1 2 3\n"), "obj")
mesh("obj with NaN", r"1 vertices that are not finite", obj("v 0 0 0\nv 1 0 0\nv 1 1 nan\nf 1 2 3\n"), "obj")
mesh("ply is text", r"room\.ply: the mesh cannot be read", lambda p: p.write_text("hello"), "ply")
mesh("glb is text", r"room\.glb: the mesh cannot be read", lambda p: p.write_text("hello"), "glb")
mesh("ply empty", r"room\.ply: the mesh cannot be read", lambda p: p.write_bytes(b""), "ply")


def exported(path: Path) -> None:
    trimesh.Trimesh(CORNERS, BOX_FACES, process=False).export(path)
    cut(path.name, 0.8)(path.parent)


mesh("ply cut off", r"room\.ply: ", exported, "ply")
mesh("glb cut off", r"room\.glb: the mesh cannot be read", exported, "glb")
mesh("stl cut off", r"room\.stl: ", exported, "stl")
mesh("ply of points", r"no triangles", lambda p: trimesh.PointCloud(CORNERS).export(p), "ply")


@table.case("mesh: unknown unit", r"unit 'yard' is unknown; use one of m, cm")
def _(tmp_path: Path) -> Act:
    return lambda: open_scan(write_scan(tmp_path), unit="yard")


@table.case("mesh: unknown axis", r"up axis 'w' is unknown; use one of x, y, z")
def _(tmp_path: Path) -> Act:
    return lambda: open_scan(write_scan(tmp_path), up_axis="w")


@table.case("mesh: a unit for a scan that states its own", r"writes metres with y up; leave the unit")
def _(tmp_path: Path) -> Act:
    return lambda: open_scan(write_scan(tmp_path), unit="cm")


@table.case("nothing there", r"no-such: there is no such file or folder")
def _(tmp_path: Path) -> Act:
    return lambda: open_scan(tmp_path / "no-such")


@table.case(
    "scan of an unknown kind",
    r"no known kind of scan: it holds a\.txt; looked for 3D Scanner App .*ARKitScenes .*bare mesh",
)
def _(tmp_path: Path) -> Act:
    (tmp_path / "a.txt").write_text("x")
    return lambda: open_scan(tmp_path)


@table.case("two meshes and no frames", r"no known kind of scan: it holds a\.ply, b\.ply")
def _(tmp_path: Path) -> Act:
    for name in ("a.ply", "b.ply"):
        trimesh.Trimesh(CORNERS, BOX_FACES).export(tmp_path / name)
    return lambda: open_scan(tmp_path)


@pytest.mark.parametrize(("prepare", "sentence"), table.cases)
def test_bad_input_is_refused_with_one_sentence(tmp_path, prepare, sentence):
    check_refused(prepare(tmp_path), sentence)
