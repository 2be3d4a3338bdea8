"""The two renderers: colours as in the scan, the same picture from both, and the fallback is named."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.camera import Camera
from gazeloc_core.errors import RenderError
from gazeloc_core.scan import Mesh, Texture
from gazeloc_core.surfaces.display_mesh import shaded
from gazeloc_core.surfaces.render import BACKGROUND, PyrenderRenderer, RayRenderer, Renderer, open_renderer

CAMERA = Camera.pinhole(320, 240, 260.0, 262.0, 161.3, 118.2)
LENS = Camera("FULL_OPENCV", 272, 270, np.array([190, 190, 136, 135, -0.13, 0.11, 0, 0, 0, 0.17, 0.05, 0.02]))
POSE = RigidTransform.from_components([0.3, -0.2, 0.1], Rotation.from_euler("xyz", [4, -8, -6], degrees=True))


def wall(distance_m: float = 2.0, cells: int = 12, half_m: float = 2.5) -> Mesh:
    """A wavy wall in front of the camera with smooth vertex colours."""
    u, v = np.meshgrid(np.linspace(-1, 1, cells + 1), np.linspace(-1, 1, cells + 1))
    z = distance_m + 0.1 * np.sin(3 * u) * np.cos(2 * v)
    vertices = np.column_stack([half_m * u.ravel(), half_m * v.ravel(), z.ravel()])
    colors = np.column_stack([60 + 90 * (u.ravel() + 1), 40 + 80 * (v.ravel() + 1), np.full(u.size, 128)])
    i = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    faces = np.concatenate([np.stack([i, i + 1, i + cells + 2], 1), np.stack([i, i + cells + 2, i + cells + 1], 1)])
    return Mesh(vertices, faces.astype(np.int32), np.rint(colors).astype(np.uint8))


def quadrants(distance_m: float = 2.0) -> Mesh:
    """A square of one texture: red upper left, green upper right, blue lower left, grey lower right."""
    image = np.zeros((64, 64, 3), np.uint8)
    image[:32, :32], image[:32, 32:], image[32:, :32], image[32:, 32:] = (
        (200, 30, 30),
        (30, 180, 40),
        (30, 40, 190),
        128,
    )
    vertices = np.array([[-1, -1, distance_m], [1, -1, distance_m], [1, 1, distance_m], [-1, 1, distance_m]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    uv = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)  # the camera's y points down, v up
    return Mesh(vertices, faces, None, Texture((image,), uv[faces], np.zeros(2, np.int32)))


@pytest.fixture
def opened():
    """Opens renderers and closes them in this thread."""
    renderers: list[Renderer] = []

    def keep(renderer: Renderer) -> Renderer:
        renderers.append(renderer)
        return renderer

    yield keep
    for renderer in renderers:
        renderer.close()


def away_from_edges(rgb: np.ndarray) -> np.ndarray:
    """The pixels whose neighbourhood is nearly of one colour."""
    wide = rgb.astype(int)
    steps = [np.abs(wide - np.roll(wide, shift, axis)).max(axis=2) for axis in (0, 1) for shift in (1, -1, 2, -2)]
    return np.max(steps, axis=0) < 12


@pytest.mark.parametrize("mesh", [wall(), quadrants()], ids=["vertex colours", "texture"])
def test_both_renderers_draw_the_same_picture(mesh, opened):
    ours = opened(PyrenderRenderer(mesh)).render(CAMERA, POSE).rgb
    rays = opened(RayRenderer(mesh)).render(CAMERA, POSE).rgb
    calm = away_from_edges(rays)
    assert calm.mean() > 0.8
    assert np.abs(ours.astype(int) - rays)[calm].mean() < 0.5


@pytest.mark.parametrize("make", [PyrenderRenderer, RayRenderer])
def test_a_square_lies_where_the_camera_projects_it_to_a_tenth_of_a_pixel(make, opened):
    square = quadrants()
    white = Mesh(square.vertices * (0.41, 0.37, 1), square.faces, np.full((4, 3), 255, np.uint8))
    rgb = opened(make(white)).render(CAMERA, POSE).rgb[..., 0]
    weight = (rgb.astype(float) - BACKGROUND[0]) / (255 - BACKGROUND[0])
    y, x = np.indices(weight.shape) + 0.5
    seen = np.array([(x * weight).sum(), (y * weight).sum()]) / weight.sum()
    to_camera = POSE.inv()
    corners = CAMERA.project(white.vertices @ to_camera.rotation.as_matrix().T + to_camera.translation)
    (x0, y0), (x1, y1) = corners.T, np.roll(corners, -1, axis=0).T
    cross = x0 * y1 - x1 * y0
    centroid = np.array([((x0 + x1) * cross).sum(), ((y0 + y1) * cross).sum()]) / (3 * cross.sum())
    assert np.abs(seen - centroid).max() < 0.1


@pytest.mark.parametrize("make", [PyrenderRenderer, RayRenderer])
def test_texture_colours_are_the_scans_own_and_upright(make, opened):
    rgb = opened(make(quadrants())).render(Camera.pinhole(200, 200, 160, 160, 100, 100), RigidTransform.identity()).rgb
    for (y, x), color in {(60, 60): (200, 30, 30), (60, 140): (30, 180, 40), (140, 60): (30, 40, 190)}.items():
        assert np.abs(rgb[y, x].astype(int) - color).max() <= 1
    assert tuple(rgb[3, 3]) == BACKGROUND


@pytest.mark.parametrize("make", [PyrenderRenderer, RayRenderer])
def test_vertex_colours_are_the_scans_own(make, opened):
    mesh = Mesh(wall().vertices, wall().faces, np.full((len(wall().vertices), 3), (64, 128, 192), np.uint8))
    rgb = opened(make(mesh)).render(CAMERA, POSE).rgb
    assert np.abs(rgb.astype(int) - (64, 128, 192)).max() <= 1


@pytest.mark.parametrize("make", [PyrenderRenderer, RayRenderer])
def test_faces_are_seen_from_both_sides(make, opened):
    mesh = quadrants()
    flipped = Mesh(mesh.vertices, mesh.faces[:, ::-1], np.full((4, 3), 90, np.uint8))
    rgb = opened(make(flipped)).render(CAMERA, RigidTransform.identity()).rgb
    assert tuple(rgb[118, 161]) == (90, 90, 90)


def test_rays_give_depth_along_the_axis_and_nan_beside_the_scan(opened):
    depth = opened(RayRenderer(quadrants(2.0))).render(CAMERA, RigidTransform.identity()).depth_m
    assert np.nanmax(np.abs(depth - 2.0)) < 1e-5
    assert np.isnan(depth[0, 0])


def test_a_distorted_camera_is_drawn_where_it_projects(opened):
    mesh = quadrants()
    rgb = opened(RayRenderer(mesh)).render(LENS, RigidTransform.identity()).rgb
    red = np.argwhere((rgb == (200, 30, 30)).all(axis=2))[:, ::-1] + 0.5
    corners = LENS.project([[-1, -1, 2], [0, -1, 2], [0, 0, 2], [-1, 0, 2]])  # bulging between, by the lens
    assert np.linalg.norm(red[:, None] - corners, axis=2).min(axis=0).max() < 1.5
    assert red[:, 0].min() < corners[0, 0] - 3  # a pinhole's edge would be straight
    with pytest.raises(RenderError, match="FULL_OPENCV"):
        opened(PyrenderRenderer(mesh)).render(LENS, RigidTransform.identity())


def test_a_scan_without_colours_gets_form_from_shade(opened):
    bare = Mesh(wall().vertices, wall().faces)
    assert len(np.unique(shaded(bare).colors)) > 5
    ours, rays = (opened(make(bare)).render(CAMERA, POSE).rgb for make in (PyrenderRenderer, RayRenderer))
    assert len(np.unique(rays)) > 5
    assert np.abs(ours.astype(int) - rays).mean() < 1


def test_pyrender_is_taken_where_there_is_egl(opened):
    renderer = opened(open_renderer(wall()))
    assert isinstance(renderer, PyrenderRenderer)
    assert renderer.note == ""


def test_without_egl_the_alternative_is_named(tmp_path):
    """glvnd finds no driver: as on a machine whose image has no EGL."""
    script = tmp_path / "draw.py"
    script.write_text(
        "import numpy as np\n"
        "from gazeloc_core.camera import Camera\n"
        "from gazeloc_core.surfaces.render import open_renderer\n"
        "from gazeloc_core.scan import Mesh\n"
        "from gazeloc_core.transforms import rigid_from_wxyz\n"
        "mesh = Mesh(np.array([[-9, -9, 2], [9, -9, 2], [0, 9, 2.0]]), [[0, 1, 2]], np.full((3, 3), 77, np.uint8))\n"
        "renderer = open_renderer(mesh)\n"
        "drawn = renderer.render(Camera.pinhole(8, 8, 8, 8, 4, 4), rigid_from_wxyz([1, 0, 0, 0], [0, 0, 0]))\n"
        "print(drawn.by, '|', renderer.note, '|', drawn.rgb[4, 4])\n"
    )
    nowhere = str(tmp_path / "nothing.json")
    env = {**os.environ, "__EGL_VENDOR_LIBRARY_FILENAMES": nowhere, "PYTHONPATH": str(Path(__file__).parents[2])}
    done = subprocess.run([sys.executable, str(script)], env=env, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    by, note, color = done.stdout.splitlines()[-1].split("|")
    assert by.strip() == "rays (Embree)"
    assert "drawn with rays" in note
    assert "[77 77 77]" in color
