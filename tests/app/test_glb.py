"""Our GLB files, read back by trimesh (an independent reader) and by the few lines of glTF that we rely on."""

import io
import json
import struct

import cv2
import numpy as np
import pytest
import trimesh

from gazeloc_core.scan import Mesh, Texture
from gazeloc_core.surfaces.display_mesh import display_mesh
from gazeloc_core.surfaces.glb import linear_from_srgb, lines_glb, mesh_glb, wires_glb

VERTICES = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0.5], [0, 1, 0.5]])
FACES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
COLORS = np.array([[64, 128, 192], [255, 0, 10], [1, 2, 3], [200, 200, 200]], np.uint8)


def parts(data: bytes) -> tuple[dict, bytes]:
    """JSON and binary chunk, with the container's own claims checked."""
    magic, version, total = struct.unpack_from("<4sII", data)
    assert (magic, version, total) == (b"glTF", 2, len(data))
    length, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    assert length % 4 == 0
    binary_length, binary_kind = struct.unpack_from("<I4s", data, 20 + length)
    assert binary_kind == b"BIN\0"
    assert 28 + length + binary_length == total
    return json.loads(data[20 : 20 + length]), data[28 + length :]


def accessor(document: dict, binary: bytes, index: int) -> np.ndarray:
    a = document["accessors"][index]
    view = document["bufferViews"][a["bufferView"]]
    kind = {5126: np.float32, 5123: np.uint16, 5125: np.uint32}[a["componentType"]]
    width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}[a["type"]]
    assert view["byteOffset"] % 4 == 0
    assert view["byteLength"] == a["count"] * width * np.dtype(kind).itemsize
    return np.frombuffer(binary, kind, a["count"] * width, view["byteOffset"]).reshape(a["count"], width)


def textured() -> Mesh:
    """Two faces, one per picture, sharing an edge whose corners have other uv on either side."""
    red, green = np.full((8, 8, 3), (250, 5, 5), np.uint8), np.full((8, 4, 3), (5, 250, 5), np.uint8)
    red[:4] = (100, 5, 5)
    uv = np.array([[[0, 0], [1, 0], [1, 1]], [[0.25, 0.125], [0.5, 0.75], [0, 1]]], np.float32)
    return Mesh(VERTICES, FACES, None, Texture((red, green), uv, np.array([0, 1], np.int32)))


def test_every_8_bit_colour_survives_the_way_through_linear_light():
    colors = np.repeat(np.arange(256, dtype=np.uint8)[:, None], 3, axis=1)
    mesh = Mesh(np.random.default_rng(0).random((256, 3)), np.arange(255).reshape(-1, 3), colors)
    document, binary = parts(mesh_glb(mesh).to_bytes())
    stored = accessor(document, binary, document["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"])
    linear = stored[:, :3] / 65535
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)  # IEC 61966-2-1
    np.testing.assert_array_equal(np.rint(srgb * 255), colors)
    assert (stored[:, 3] == 65535).all()


def test_the_material_is_unlit_two_sided_and_there_are_no_normals():
    document, _ = parts(mesh_glb(Mesh(VERTICES, FACES, COLORS)).to_bytes())
    material = document["materials"][0]
    assert material["extensions"] == {"KHR_materials_unlit": {}}
    assert "KHR_materials_unlit" in document["extensionsUsed"]
    assert material["doubleSided"]
    assert "NORMAL" not in document["meshes"][0]["primitives"][0]["attributes"]


def test_trimesh_reads_the_mesh():
    loaded = trimesh.load(io.BytesIO(mesh_glb(Mesh(VERTICES, FACES, COLORS)).to_bytes()), file_type="glb", force="mesh")
    np.testing.assert_allclose(loaded.vertices, VERTICES, atol=1e-6)
    np.testing.assert_array_equal(loaded.faces, FACES)


def test_each_corner_keeps_its_place_in_its_picture():
    mesh = textured()
    document, binary = parts(mesh_glb(mesh).to_bytes())
    for face, primitive in enumerate(document["meshes"][0]["primitives"]):
        corner = accessor(document, binary, primitive["indices"])[:, 0]
        points = accessor(document, binary, primitive["attributes"]["POSITION"])[corner]
        uv = accessor(document, binary, primitive["attributes"]["TEXCOORD_0"])[corner]
        np.testing.assert_allclose(points, VERTICES[FACES[face]], atol=1e-6)
        np.testing.assert_allclose(uv[:, 0], mesh.texture.uv_of_corner[face, :, 0], atol=1e-6)
        np.testing.assert_allclose(1 - uv[:, 1], mesh.texture.uv_of_corner[face, :, 1], atol=1e-6)
        material = document["materials"][primitive["material"]]["pbrMetallicRoughness"]
        view = document["bufferViews"][document["images"][material["baseColorTexture"]["index"]]["bufferView"]]
        jpeg = binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        picture = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
        assert np.abs(picture.astype(int) - mesh.texture.images[face]).max() <= 12


def test_a_corner_that_two_faces_share_with_one_uv_is_stored_once():
    uv = np.float32(VERTICES[:, :2])[FACES]
    mesh = Mesh(VERTICES, FACES, None, Texture(textured().texture.images[:1], uv, np.zeros(2, np.int32)))
    document, _ = parts(mesh_glb(mesh).to_bytes())
    assert [a["count"] for a in document["accessors"] if a["type"] == "VEC3"] == [4]


def test_faces_without_picture_are_grey_beside_those_with_one():
    texture = textured().texture
    mesh = Mesh(VERTICES, FACES, None, Texture(texture.images, texture.uv_of_corner, np.array([0, -1], np.int32)))
    document, _ = parts(mesh_glb(mesh).to_bytes())
    materials = [m["pbrMetallicRoughness"] for m in document["materials"]]
    assert ["baseColorTexture" in m for m in materials] == [True, False]
    np.testing.assert_allclose(materials[1]["baseColorFactor"][:3], linear_from_srgb([128] * 3), atol=1e-6)


def test_the_tint_and_which_sides_are_drawn_are_in_the_material_only():
    glb = mesh_glb(Mesh(VERTICES, FACES, COLORS))
    document, binary = parts(glb.to_bytes(tint=(255, 128, 0)))
    material = document["materials"][0]
    np.testing.assert_allclose(
        material["pbrMetallicRoughness"]["baseColorFactor"], [*linear_from_srgb([255, 128, 0]), 1.0]
    )
    assert parts(glb.to_bytes(two_sided=False))[0]["materials"][0]["doubleSided"] is False
    plain, plain_binary = parts(glb.to_bytes())
    assert plain["materials"][0]["doubleSided"] is True
    assert binary == plain_binary


@pytest.mark.parametrize("shape", [(3,), (2, 3), (2, 2, 3)])
def test_lines_take_one_colour_or_one_per_line_or_per_end(shape):
    segments = np.random.default_rng(1).normal(size=(2, 2, 3))
    colors = np.random.default_rng(2).integers(0, 255, shape).astype(np.uint8)
    document, binary = parts(lines_glb(segments, colors).to_bytes())
    primitive = document["meshes"][0]["primitives"][0]
    assert primitive["mode"] == 1
    np.testing.assert_allclose(
        accessor(document, binary, primitive["attributes"]["POSITION"]), segments.reshape(-1, 3), atol=1e-6
    )
    expected = np.broadcast_to(colors[:, None] if colors.ndim == 2 else colors, (2, 2, 3)).reshape(-1, 3)
    stored = accessor(document, binary, primitive["attributes"]["COLOR_0"])[:, :3] / 65535
    np.testing.assert_allclose(stored, linear_from_srgb(expected), atol=1e-5)


def test_wires_share_their_ends_and_keep_each_colour():
    colors = np.array([[1, 2, 3], [9, 8, 7], [200, 0, 50], [0, 0, 0]], np.uint8)
    document, binary = parts(wires_glb(VERTICES, np.array([[0, 1], [1, 2], [2, 0]]), colors).to_bytes())
    primitive = document["meshes"][0]["primitives"][0]
    assert primitive["mode"] == 1
    assert accessor(document, binary, primitive["indices"]).ravel().tolist() == [0, 1, 1, 2, 2, 0]
    np.testing.assert_allclose(accessor(document, binary, primitive["attributes"]["POSITION"]), VERTICES)
    stored = accessor(document, binary, primitive["attributes"]["COLOR_0"])[:, :3] / 65535
    np.testing.assert_allclose(stored, linear_from_srgb(colors), atol=1e-5)


def test_a_mesh_for_display_keeps_place_and_colour_with_fewer_faces():
    u, v = np.meshgrid(np.linspace(0, 4, 120), np.linspace(0, 3, 90))
    vertices = np.column_stack([u.ravel(), v.ravel(), 0.1 * np.sin(u.ravel())])
    i = (np.arange(89)[:, None] * 120 + np.arange(119)).ravel()
    faces = np.concatenate([np.stack([i, i + 1, i + 121], 1), np.stack([i, i + 121, i + 120], 1)]).astype(np.int32)
    colors = np.column_stack([u.ravel() * 60, v.ravel() * 80, np.full(u.size, 9)]).astype(np.uint8)
    mesh = Mesh(vertices, faces, colors)
    small = display_mesh(mesh, max_faces=4000)
    assert 2500 < len(small.faces) <= 4000
    assert np.abs(small.vertices[:, 2] - 0.1 * np.sin(small.vertices[:, 0])).max() < 0.005
    assert np.abs(small.colors[:, 0] - small.vertices[:, 0] * 60).max() < 2
    assert np.abs(small.bounds - mesh.bounds).max() < 0.1
    assert display_mesh(mesh, max_faces=len(faces)) is mesh


def test_a_textured_mesh_for_display_keeps_each_face_in_its_own_picture():
    grid = np.stack(np.meshgrid(np.arange(40.0), np.arange(40.0)), -1).reshape(-1, 2)
    i = (np.arange(39)[:, None] * 40 + np.arange(39)).ravel()
    faces = np.concatenate([np.stack([i, i + 1, i + 41], 1), np.stack([i, i + 41, i + 40], 1)]).astype(np.int32)
    vertices = np.column_stack([grid, np.zeros(len(grid))])
    uv = np.float32(grid / 39)[faces]
    picture = textured().texture.images[0]
    small = display_mesh(Mesh(vertices, faces, None, Texture((picture,), uv, np.zeros(len(faces), np.int32))), 800)
    placed = small.vertices[small.faces][..., :2] / 39
    assert np.abs(placed - small.texture.uv_of_corner).max() < 0.06
