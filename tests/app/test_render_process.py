"""The drawing process: real pictures from a real child, latest wins, and life after a crash."""

import asyncio
import os
import signal
import time
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest
from gazeloc_app.drawing.render_jobs import Cast, Describe, Frame, Render, Sources, camera_text
from gazeloc_app.drawing.render_process import Closing, RenderProcess, Superseded

from gazeloc_core.camera import Camera
from gazeloc_core.errors import GazelocError, InputError, RenderError
from gazeloc_core.frames.sources import ImageFrames
from gazeloc_core.frames.undistort import Undistorter
from gazeloc_core.recording import Recording
from gazeloc_core.scan import Mesh

LENS = Camera("FULL_OPENCV", 272, 270, np.array([190, 190, 136, 135, -0.13, 0.11, 0, 0, 0, 0.17, 0.05, 0.02]))
PINHOLE = Camera.pinhole(160, 120, 100, 100, 80, 60)
UPRIGHT = {"wxyz": (1.0, 0.0, 0.0, 0.0), "center": (0.0, 0.0, 0.0)}


def board(color=(200, 60, 30)) -> Mesh:
    """A board two metres ahead, of one colour, that fills the view."""
    vertices = np.array([[-9, -9, 2], [9, -9, 2], [9, 9, 2], [-9, 9, 2.0]])
    return Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]]), np.full((4, 3), color, np.uint8))


def slow_board(seconds: float) -> Mesh:
    time.sleep(seconds)
    return board()


def broken_mesh() -> Mesh:
    raise InputError("room.obj: the mesh is empty; export it again.")


def deadly_mesh() -> Mesh:
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError


def walk(folder: Path) -> Recording:
    paths = tuple(sorted(folder.glob("*.png")))
    return Recording(folder, "images", LENS, np.arange(len(paths)), ImageFrames(paths, LENS))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("walk")
    ramp = np.add.outer(np.arange(270), np.arange(272)) // 3
    for index in range(3):
        cv2.imwrite(
            str(folder / f"{index}.png"), np.stack([ramp, ramp, np.full_like(ramp, 60 * index)], 2).astype(np.uint8)
        )
    return folder


@pytest.fixture(scope="module")
def renderer(folder):
    process = RenderProcess(Sources(mesh=board, recordings={"walk": partial(walk, folder)}))
    yield process
    process.close()


@pytest.fixture
def made():
    """Makes processes that end with the test."""
    processes = []

    def make(*args, **kwargs):
        processes.append(RenderProcess(*args, **kwargs))
        return processes[-1]

    yield make
    for process in processes:
        process.close()


def decoded(jpeg: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)[..., ::-1].astype(int)


@pytest.mark.parametrize("camera", [PINHOLE, LENS], ids=["pinhole", "distorted"])
def test_a_render_has_the_cameras_size_and_the_scans_colours(renderer, camera):
    picture = decoded(renderer.submit(Render(camera=camera_text(camera), **UPRIGHT)).result(60))
    assert picture.shape == (camera.height, camera.width, 3)
    assert np.abs(picture[camera.height // 2, camera.width // 2] - (200, 60, 30)).max() <= 3


def test_a_render_is_scaled_on_demand(renderer):
    picture = decoded(renderer.submit(Render(camera=camera_text(PINHOLE), width=80, **UPRIGHT)).result(60))
    assert picture.shape == (60, 80, 3)


def test_a_frame_is_undistorted_and_can_be_had_as_recorded(renderer, folder):
    recorded = decoded(renderer.submit(Frame(recording="walk", index=2, as_recorded=True)).result(60))
    original = cv2.imread(str(folder / "2.png"))[..., ::-1]
    assert np.abs(recorded - original).mean() < 2
    undistorted = decoded(renderer.submit(Frame(recording="walk", index=2)).result(60))
    expected = Undistorter.of(LENS).image(np.ascontiguousarray(original)).astype(int)
    assert undistorted.shape == expected.shape != recorded.shape
    assert np.abs(undistorted - expected).mean() < 2
    assert decoded(renderer.submit(Frame(recording="walk", index=2, width=100)).result(60)).shape[1] == 100


def test_rays_are_cast_to_points(renderer):
    answer = renderer.submit(Cast(origins=[[0.5, 0, 0], [0, 0, 5]], directions=[[0, 0, 2], [0, 0, 1]])).result(60)
    np.testing.assert_allclose(answer.points[0], [0.5, 0, 2], atol=1e-6)
    assert answer.distance[0] == pytest.approx(1.0)
    assert np.isnan(answer.points[1]).all()
    assert np.isinf(answer.distance[1])


def test_the_renderer_tells_its_name(renderer):
    description = renderer.submit(Describe()).result(60)
    assert description.by in ("pyrender (OpenGL)", "rays (Embree)")
    assert bool(description.note) == (description.by == "rays (Embree)")


@pytest.mark.parametrize(
    ("job", "sentence"),
    [
        (Frame(recording="walk", index=3), "There is no frame 3"),
        (Frame(recording="other", index=0), "no recording 'other'"),
        (Render(camera=camera_text(PINHOLE), wxyz=(0.0, 0.0, 0.0, 0.0), center=(0.0, 0.0, 0.0)), "quaternion"),
    ],
)
def test_bad_requests_are_sentences_and_the_process_lives_on(renderer, job, sentence):
    pid = renderer.pid
    with pytest.raises(GazelocError, match=sentence):
        renderer.submit(job).result(60)
    renderer.submit(Describe()).result(60)
    assert renderer.pid == pid or pid is None


def test_a_file_that_cannot_be_read_is_its_own_sentence(made):
    with pytest.raises(InputError, match=r"room\.obj"):
        made(Sources(mesh=broken_mesh)).submit(Describe()).result(60)


def test_of_many_requests_with_one_key_the_first_and_the_last_are_drawn(made, folder):
    process = made(Sources(mesh=partial(slow_board, 1.0), recordings={"walk": partial(walk, folder)}))
    first = process.submit(Describe())
    views = [process.submit(Render(camera=camera_text(PINHOLE), width=10 + i, **UPRIGHT), "me") for i in range(20)]
    other = process.submit(Frame(recording="walk", index=0), "someone else")
    for view in views[:-1]:
        with pytest.raises(Superseded):
            view.result(60)
    assert decoded(views[-1].result(60)).shape[1] == 29
    assert first.result(60).by
    assert other.result(60)


def test_a_click_goes_before_the_pictures(made):
    process = made(Sources(mesh=partial(slow_board, 1.0)))
    process.submit(Describe())
    finished = []
    picture = process.submit(Render(camera=camera_text(PINHOLE), **UPRIGHT))
    picture.add_done_callback(lambda _: finished.append("picture"))
    click = process.submit(Cast(origins=[[0, 0, 0]], directions=[[0, 0, 1]]))
    click.add_done_callback(lambda _: finished.append("click"))
    picture.result(60)
    assert finished == ["click", "picture"]


def test_after_a_crash_it_says_so_and_draws_again(made):
    troubles = []
    process = made(Sources(mesh=board), troubles.append)
    process.submit(Describe()).result(60)
    first = process.pid
    os.kill(first, signal.SIGKILL)
    with pytest.raises(RenderError, match=r"died .*exit code -9"):
        process.submit(Render(camera=camera_text(PINHOLE), **UPRIGHT)).result(60)
    assert len(troubles) == 1
    assert process.submit(Render(camera=camera_text(PINHOLE), **UPRIGHT)).result(60)
    assert process.pid != first


def test_what_kills_it_every_time_is_not_tried_for_ever(made):
    process = made(Sources(mesh=deadly_mesh), lambda sentence: None)
    sentences = []
    for _ in range(4):
        with pytest.raises(RenderError) as died:
            process.submit(Describe()).result(60)
        sentences.append(str(died.value))
    assert "3 times in a row" in sentences[-1]
    assert process.pid is None


def test_a_picture_is_drawn_once_until_the_sources_are_reopened(made, folder):
    process = made(Sources(mesh=board, recordings={"walk": partial(walk, folder)}))
    job = Frame(recording="walk", index=1)
    picture = process.submit(job).result(60)
    first = process.pid
    os.kill(first, signal.SIGSTOP)
    assert process.submit(job).result(5) == picture
    os.kill(first, signal.SIGCONT)
    process.reopen()
    assert process.submit(job).result(60) == picture
    assert process.pid != first


def test_the_event_loop_stays_free(renderer):
    async def both():
        longest, last = 0.0, time.perf_counter()
        job = Render(camera=camera_text(LENS), wxyz=(1.0, 0.0, 0.0, 0.0), center=(0.1, 0.0, 0.0))
        drawing = asyncio.create_task(renderer.request(job))
        while not drawing.done():
            await asyncio.sleep(0.005)
            longest, last = max(longest, time.perf_counter() - last), time.perf_counter()
        assert await drawing
        return longest

    assert asyncio.run(both()) < 0.25


def test_after_closing_nothing_hangs(made):
    process = made(Sources(mesh=partial(slow_board, 5.0)))
    running, waiting = process.submit(Describe()), process.submit(Describe(), "key")
    process.close()
    for future in (running, waiting, process.submit(Describe())):
        with pytest.raises(Closing):
            future.result(10)
    assert process.pid is None
