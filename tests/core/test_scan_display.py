"""The scan made fit for the screen: kept, found again, made anew when it should be; and the first glimpse of it."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from gazeloc_core.errors import InputError
from gazeloc_core.project import Project, RecordingEntry, ScanEntry, Settings
from gazeloc_core.scan import Mesh, Texture
from gazeloc_core.stages.display import load_display, make_display
from gazeloc_core.surfaces.glb import Glb, mesh_glb
from gazeloc_core.surfaces.scan_display import glimpse, scan_display


def ball(color) -> trimesh.Trimesh:
    mesh = trimesh.creation.icosphere(4)
    mesh.visual.vertex_colors = np.tile([*color, 255], (len(mesh.vertices), 1))
    return mesh


@pytest.fixture
def project(tmp_path):
    ball((10, 200, 30)).export(tmp_path / "ball.ply")
    scan = ScanEntry(path=tmp_path / "ball.ply", unit="m", up_axis="z")
    return Project.create(tmp_path / "project", Settings(scan=scan, recordings={"a": RecordingEntry(path=tmp_path)}))


@pytest.mark.parametrize("vertex", [-1, 7])
def test_a_face_that_names_no_vertex_is_told_by_the_one_that_it_names(vertex):
    with pytest.raises(InputError, match=f"name vertex {vertex}, but only 3"):
        Mesh(np.eye(3), np.array([[0, 1, vertex]]))


def test_what_is_kept_is_what_was_made(project):
    assert load_display(project) is None
    made, kept = make_display(project), load_display(project)
    assert kept is not None
    assert kept.glb.to_bytes() == made.glb.to_bytes()
    assert (
        (kept.front, kept.faces, kept.faces_of_scan) == (made.front, made.faces, made.faces_of_scan) == (-1, 5120, 5120)
    )


def test_another_scan_in_the_same_file_needs_another_display(project, tmp_path):
    make_display(project)
    ball((200, 10, 30)).export(tmp_path / "ball.ply")
    assert load_display(Project.open(project.folder)) is None


@pytest.mark.parametrize("damage", [lambda data: data[:-7], lambda data: b"", lambda data: b"PK" + data[2:]])
def test_a_damaged_display_is_made_anew_and_not_shown(project, damage):
    make_display(project)
    path = project.scan_artifact("display").folder / "scan.glb"
    path.write_bytes(damage(path.read_bytes()))
    assert load_display(project) is None


def test_a_glb_is_read_back_as_it_was_and_anything_else_is_refused(tmp_path):
    glb = mesh_glb(Mesh(np.eye(3), np.array([[0, 1, 2]]), np.full((3, 3), 7, np.uint8)))
    again = Glb.from_bytes(glb.to_bytes(), "a.glb")
    assert again.to_bytes((9, 8, 7)) == glb.to_bytes((9, 8, 7))
    with pytest.raises(InputError, match=r"a\.glb: .*not a \.glb"):
        Glb.from_bytes(b"nothing", "a.glb")


def test_the_display_has_few_faces_that_are_turned_to_where_the_scan_was_made(project):
    mesh = ball((1, 2, 3))
    display = scan_display(Mesh(mesh.vertices, mesh.faces), [[0, 0, 0]], max_faces=1000)
    assert display.faces <= 1000 < display.faces_of_scan
    assert display.front == -1  # the ball's normals point outwards, and it is seen from inside


def test_a_glimpse_lies_on_the_surface_in_its_colours():
    mesh = ball((10, 200, 30))
    colors = np.asarray(mesh.visual.vertex_colors)[:, :3]
    points, seen = glimpse(Mesh(mesh.vertices, mesh.faces, colors), 500)
    assert 400 < len(points) <= 500
    assert cKDTree(mesh.triangles_center).query(points)[0].max() < 1e-6
    assert (seen == (10, 200, 30)).all()


def test_a_glimpse_of_a_textured_scan_has_the_pictures_colours():
    picture = np.zeros((2, 2, 3), np.uint8)
    picture[0, 1] = (9, 99, 199)  # upper right: u near 1, v near 1
    uv = np.array([[[0.9, 0.9], [0.8, 0.9], [0.9, 0.8]]] * 2, np.float32)
    mesh = Mesh(np.eye(3), np.array([[0, 1, 2]] * 2), None, Texture((picture,), uv, np.array([0, -1], np.int32)))
    assert glimpse(mesh, 10)[1].tolist() == [[9, 99, 199], [128, 128, 128]]
