"""Bare meshes: units, axes, node transforms and texture coordinates."""

import cv2
import numpy as np
import pytest
import trimesh
from PIL import Image
from tiny_captures import BOX_FACES, CORNERS, ROOM_M, picture

from gazeloc_core.errors import InputError
from gazeloc_core.readers import open_scan
from gazeloc_core.readers.obj_file import read_obj
from gazeloc_core.surfaces.raycast import Raycaster


def write_box(path, scale=1.0, **visual):
    trimesh.Trimesh(CORNERS * scale, BOX_FACES, process=False, **visual).export(path)
    return path


@pytest.mark.parametrize("ending", ["ply", "obj", "stl"])
def test_a_mesh_without_unit_asks_and_says_how_large_the_room_would_be(tmp_path, ending):
    path = write_box(tmp_path / f"room.{ending}", scale=100)
    with pytest.raises(
        InputError, match=r"400 x 260 x 300 m if in m, 4 x 2.6 x 3 m if in cm.*--unit .* --up"
    ) as raised:
        open_scan(path)
    assert str(path) in str(raised.value)
    scan = open_scan(path, unit="cm", up_axis="y")
    np.testing.assert_allclose(scan.mesh.bounds, [[0, 0, 0], ROOM_M], atol=1e-6)


def test_up_axis_is_said_and_axes_stay(tmp_path):
    scan = open_scan(write_box(tmp_path / "room.ply"), unit="m", up_axis="-z")
    assert scan.up_axis == "-z"
    np.testing.assert_allclose(scan.mesh.bounds[1], ROOM_M)


def test_glb_is_metres_and_y_up_and_its_nodes_are_placed(tmp_path):
    scene = trimesh.Scene()
    move = trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0])
    move[:3, 3] = [1, 2, 3]
    scene.add_geometry(trimesh.Trimesh(CORNERS, BOX_FACES, process=False), transform=move)
    scene.export(tmp_path / "room.glb")
    scan = open_scan(tmp_path / "room.glb")
    assert scan.up_axis == "y"
    expected = CORNERS @ move[:3, :3].T + move[:3, 3]
    np.testing.assert_allclose(scan.mesh.bounds, [expected.min(axis=0), expected.max(axis=0)], atol=1e-6)


def test_what_people_say_of_a_glb_counts_more_than_its_standard(tmp_path):
    scan = open_scan(write_box(tmp_path / "room.glb", scale=1000), unit="mm", up_axis="z")
    np.testing.assert_allclose(scan.mesh.bounds, [[0, 0, 0], ROOM_M], atol=1e-6)
    assert scan.up_axis == "z"
    assert any("read in mm with z up" in note and "standard" in note for note in scan.notes)


def test_a_glb_as_large_as_a_town_is_asked_for_its_unit(tmp_path):
    town = write_box(tmp_path / "room.glb", scale=1000)
    with pytest.raises(InputError, match=r"4e\+03 x .* if in m, .* 4 x 2.6 x 3 m if in mm.*--unit"):
        open_scan(town)
    assert any("very large" in note for note in open_scan(town, unit="m").notes)


def quadrant_picture():
    image = np.zeros((8, 8, 3), np.uint8)
    image[:4, :4], image[:4, 4:], image[4:, :4], image[4:, 4:] = (250, 0, 0), (0, 250, 0), (0, 0, 250), (250, 250, 0)
    return image


def colors_of_square(scan):
    """Colours of the square's lower left, lower right, upper left and upper right, seen from +z."""
    caster = Raycaster(scan.mesh)
    origins = np.array([[x, y, 1.0] for y in (0.2, 0.8) for x in (0.25, 0.75)])
    return caster.colors(caster.cast(origins, np.tile([0, 0, -1.0], (4, 1))))


EXPECTED = [(0, 0, 250), (250, 250, 0), (250, 0, 0), (0, 250, 0)]


def test_obj_texture_lies_the_right_way_up(tmp_path):
    cv2.imwrite(str(tmp_path / "my picture.png"), quadrant_picture()[:, :, ::-1])
    (tmp_path / "a.mtl").write_text("newmtl m\nmap_Kd my picture.png\n")
    (tmp_path / "a.obj").write_text(
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl m\n"
        "f 1/1 2/2 3/3 -1/-1\n"
    )
    np.testing.assert_array_equal(colors_of_square(open_scan(tmp_path, unit="m", up_axis="z")), EXPECTED)


def test_glb_texture_lies_the_right_way_up(tmp_path):
    square = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]], process=False)
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.fromarray(quadrant_picture()))
    square.visual = trimesh.visual.TextureVisuals(uv=[[0, 0], [1, 0], [1, 1], [0, 1]], material=material)
    square.export(tmp_path / "a.glb")
    np.testing.assert_array_equal(colors_of_square(open_scan(tmp_path / "a.glb")), EXPECTED)


def test_several_materials_each_keep_their_picture(tmp_path):
    for i in range(2):
        cv2.imwrite(str(tmp_path / f"t{i}.png"), np.full((4, 4, 3), 50 + 100 * i, np.uint8))
    (tmp_path / "a.mtl").write_text("newmtl a\nmap_Kd t0.png\nnewmtl b\nmap_Kd t1.png\n")
    (tmp_path / "a.obj").write_text(
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nusemtl b\nf 1/1 2/1 3/1\nusemtl a\nf 1/1 3/1 4/1\n"
    )
    mesh = open_scan(tmp_path, unit="m", up_axis="y").mesh
    of_face = [mesh.texture.images[i][0, 0, 0] for i in mesh.texture.image_of_face]
    assert of_face == [150, 50]


def test_vertex_colours_of_ply_and_obj_survive(tmp_path):
    colors = picture(8, 1, 0)[0, :8]
    colors = np.arange(24, dtype=np.uint8).reshape(8, 3) * 10
    write_box(tmp_path / "a.ply", vertex_colors=colors)
    np.testing.assert_array_equal(open_scan(tmp_path / "a.ply", unit="m", up_axis="y").mesh.colors, colors)
    lines = [
        f"v {x} {y} {z} {r / 255} {g / 255} {b / 255}" for (x, y, z), (r, g, b) in zip(CORNERS, colors, strict=True)
    ]
    (tmp_path / "b.obj").write_text("\n".join([*lines, *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in BOX_FACES)]))
    np.testing.assert_array_equal(open_scan(tmp_path / "b.obj", unit="m", up_axis="y").mesh.colors, colors)


@pytest.mark.parametrize("pattern", ["{v}", "{v}/{t}", "{v}//{n}", "{v}/{t}/{n}"])
@pytest.mark.parametrize("with_polygon", [False, True])
def test_every_way_to_write_a_corner_reads_the_same(tmp_path, pattern, with_polygon):
    corners = [[(1, 4), (2, 3), (3, 2)], [(1, 4), (3, 2), (4, 1)]]
    rows = [" ".join(pattern.format(v=v, t=t, n=5 - v) for v, t in face) for face in corners]
    polygon = [" ".join(pattern.format(v=v, t=t, n=5 - v) for v, t in [*corners[0], corners[1][2]])]
    points = ["v 0 0 0", "v 1 0 0", "v 1 1 0", "v 0 1 0", "vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1"]
    text = "\n".join([*points, *["vn 0 0 1"] * 4, *(f"f {row}" for row in (polygon if with_polygon else rows))])
    (tmp_path / "a.obj").write_text(text)
    obj = read_obj(tmp_path / "a.obj")
    np.testing.assert_array_equal(obj.corners[..., 0], [[0, 1, 2], [0, 2, 3]])
    expected = [[3, 2, 1], [3, 1, 0]] if "{t}" in pattern else np.full((2, 3), -1)
    np.testing.assert_array_equal(obj.corners[..., 1], expected)
