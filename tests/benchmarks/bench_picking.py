"""Clicks on a scan of 500,000 triangles: how exact, and how quick, from the page to the marker.

The room is the box room of the tests with its faces split until there are half a million. Exactness: 300 random places
of the surface, each seen from 3 m under up to some 25 degrees, are clicked as a page reports a click (the ray through
the centre of the pixel in which the place is, of a view 800 pixels high, 50 degrees); the error is against the place,
and the target is half of what a pixel covers there, which is about what the centre of a pixel is off by itself. No
browser is needed for that: that a page's ray is the pixel's is tested in tests/e2e.

Quickness: in a browser, pointer up to the node in the page's scene, a keypoint against an empty callback that adds one
node, in turns by the same gesture; on that room, in the app as it is, with alignment and suggestions as they come.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import trimesh
from bench_app import SIZE, _app, bench_round_trip
from box_room import make_room, room_mesh
from e2e.page import chromium_path, launch
from fake_project import click, make_project
from gazeloc_app.actions.live import FitFound
from gazeloc_app.data import ProjectData
from gazeloc_app.keypoints.live_alignment import LiveAlignment
from gazeloc_app.keypoints.picking import pick_mesh
from gazeloc_app.state import AppState
from playwright.sync_api import sync_playwright
from scipy.spatial.transform import Rotation

from gazeloc_core.arrays import Floats
from gazeloc_core.camera import Camera
from gazeloc_core.project import Project
from gazeloc_core.scan import Mesh
from gazeloc_core.surfaces.raycast import Raycaster

Row = tuple[str, str, bool]
TRIANGLES, CLICKS, AWAY_M = 500_000, 300, 3.0
HEIGHT_PX, FOV_RAD = SIZE["height"], np.radians(50)


def bench_picking(work: Path) -> list[Row]:
    """All targets."""
    mesh = large_room()
    rows = [bench_exactness(mesh), *bench_live(work / "live")]
    path = chromium_path()
    if path is None:
        return [*rows, ("round trip of a click: not measured, no chromium is installed", "", False)]
    with sync_playwright() as playwright, _app(large_project(work, mesh)) as app:
        browser = launch(playwright, str(path))
        name, text, is_met = bench_round_trip(browser, app, pairs=12)
        browser.close()
    return [*rows, (f"{len(mesh.faces)} triangles: {name}", text, is_met)]


def bench_exactness(mesh: Mesh) -> Row:
    """Errors in 3D of clicks at the centres of pixels."""
    rng, raycaster = np.random.default_rng(0), Raycaster(mesh)
    focal_px = HEIGHT_PX / 2 / np.tan(FOV_RAD / 2)
    view = Camera.pinhole(SIZE["width"], HEIGHT_PX, focal_px, focal_px, SIZE["width"] / 2, HEIGHT_PX / 2)
    errors, halves = [], []
    while len(errors) < CLICKS:
        face = mesh.vertices[mesh.faces[rng.integers(len(mesh.faces))]]
        place = rng.dirichlet((1, 1, 1)) @ face
        normal = np.cross(face[1] - face[0], face[2] - face[0])
        aside = rng.normal(size=3)
        direction = normal / np.linalg.norm(normal) * rng.choice((-1, 1)) + 0.45 * aside / np.linalg.norm(aside)
        eye = place + AWAY_M * direction / np.linalg.norm(direction)
        rotation = _facing(eye, place + 0.5 * rng.normal(size=3))
        pixel = np.floor(view.project(rotation.inv().apply(place - eye))[0]) + 0.5
        if not view.contains(pixel)[0] or not _is_seen(raycaster, eye, place):
            continue
        found = pick_mesh(raycaster, eye, rotation.apply(view.unproject(pixel)[0]))
        assert found is not None
        errors.append(float(np.linalg.norm(found - place)))
        halves.append(AWAY_M / focal_px / 2)
    median, half = float(np.median(errors)), float(np.median(halves))
    text = f"median {1000 * median:.2f} mm, half a pixel is {1000 * half:.2f} mm (95 %: {_mm(errors, 95)} mm)"
    return (
        f"{len(mesh.faces)} triangles, {CLICKS} clicks: median error <= half a pixel's footprint",
        text,
        median <= half,
    )


def bench_live(work: Path, count: int = 50, few: int = 5) -> list[Row]:
    """A change among 50 pairs to the alignment that answers it, evidence and file included; and against 5 pairs."""
    work.mkdir()
    many, little = _Follower(work / "many", count), _Follower(work / "few", few)
    for number in range(14):
        many.move_one(number)
        little.move_one(number)
    took_ms, work_ms = (1000 * float(np.median(times)) for times in (many.took[2:], many.worked[2:]))
    ratio = float(np.median(many.worked[2:])) / float(np.median(little.worked[2:]))
    return [
        (
            f"{count} pairs, one moved: the alignment that answers it, with its file <= 50 ms",
            f"{took_ms:.0f} ms, of it {work_ms:.0f} ms of work",
            took_ms <= 50,
        ),
        (f"the work of that <= 3 times that with {few} pairs, in turns", f"{ratio:.1f} times", ratio <= 3),
    ]


class _Follower:
    """A live alignment on a project of its own; `took` and `worked` are the seconds of each answer, wall and CPU."""

    def __init__(self, folder: Path, count: int):
        folder.mkdir()
        self._project = make_project(folder)
        room, rng = make_room(points=1, images=1), np.random.default_rng(2)
        self._in_scan = rng.uniform((-2.4, -1.2, -1.9), (2.4, 1.2, 1.9), (count, 3))
        noisy = self._in_scan + rng.normal(0, 0.01, self._in_scan.shape)
        click(self._project, self._in_scan, room.scan_from_sfm.inverse().apply(noisy))
        self._found: list[FitFound] = []
        self._live = LiveAlignment(ProjectData(self._project), self._found.append)  # type: ignore[arg-type]
        self._state = AppState(("walk",), "walk")
        self.took: list[float] = []
        self.worked: list[float] = []

    def move_one(self, number: int) -> None:
        """Move the first pair by so many millimetres, and wait for the answer; the first ones read the project."""
        place = tuple((self._in_scan[0] + 0.001 * number).tolist())
        changed = self._state.with_keypoints(self._project.keypoints("walk").change("k1", scan=place))
        self._live.follow(self._state, changed)
        start, start_work = time.perf_counter(), time.thread_time()
        assert self._live.fit_wanted()
        self.took.append(time.perf_counter() - start)
        self.worked.append(time.thread_time() - start_work)
        assert self._found[-1].key is not None
        self._state = changed


def large_room() -> Mesh:
    """The box room with its faces split in four until there are half a million or more."""
    mesh = room_mesh(noise_m=0.0)
    vertices, faces = mesh.vertices, mesh.faces
    while len(faces) < TRIANGLES:
        vertices, faces = trimesh.remesh.subdivide(vertices, faces)
    return Mesh(vertices, faces)


def large_project(work: Path, mesh: Mesh) -> Project:
    """The tests' project of that room, its scan replaced by the large one."""
    project = make_project(work)
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(work / "room.obj")
    return project


def _facing(eye: Floats, target: Floats) -> Rotation:
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, (0.1, 1.0, 0.2))
    right /= np.linalg.norm(right)
    return Rotation.from_matrix(np.stack([right, np.cross(forward, right), forward], axis=1))


def _is_seen(raycaster: Raycaster, eye: Floats, place: Floats) -> bool:
    hit = raycaster.cast(eye, place - eye)
    return bool(abs(hit.distance[0] - 1) < 1e-4)


def _mm(values: list[float], percent: float) -> str:
    return f"{1000 * float(np.percentile(values, percent)):.1f}"
