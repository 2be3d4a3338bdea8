"""The frame that is shown in the scene: pictures that come late, frames without pose, and what was hidden meanwhile."""

from concurrent.futures import Future

import numpy as np
import pytest
from gazeloc_app.drawing.jpeg import jpeg_of
from gazeloc_app.scene.shown_frame import ShownFrame

from gazeloc_core.stages.registration import align_keypoints


class Drawer:
    """Draws when it is told to."""

    def __init__(self) -> None:
        self.asked: list[Future] = []

    def submit(self, job, key):
        self.asked.append(Future())
        return self.asked[-1]

    def draw(self, number: int, grey: int) -> None:
        self.asked[number].set_result(jpeg_of(np.full((30, 40, 3), grey, np.uint8)))


@pytest.fixture
def shown(app):
    key = align_keypoints(app.project, "walk").key
    drawer = Drawer()
    frame = ShownFrame(app.server, app.data, drawer)
    trajectory = app.data.trajectory("walk", key)
    posed = np.flatnonzero(trajectory.has_pose)[:2].tolist()

    def show(index: int) -> None:
        frame.show("walk", index, trajectory, is_playing=True)  # which does not wait for rest

    yield frame, show, posed, drawer, app.server.scene._handle_from_node_name
    frame.stop()


def picture_of(nodes):
    """Red of the first pixel of the picture at the camera, None without one."""
    image = nodes["/selected"].image
    return None if image is None else int(np.asarray(image)[0, 0, 0])


def test_a_picture_that_comes_after_the_next_frame_was_chosen_is_left_out(shown):
    _, show, (first, second), drawer, nodes = shown
    show(first)
    show(second)
    assert picture_of(nodes) is None
    drawer.draw(0, 50)
    assert picture_of(nodes) is None
    drawer.draw(1, 200)
    assert picture_of(nodes) == pytest.approx(200, abs=3)


def test_a_camera_that_was_hidden_stays_hidden_with_the_next_frame_and_its_picture(shown):
    frame, show, (first, second), drawer, nodes = shown
    show(first)
    frame.show_camera(False)
    show(second)
    drawer.draw(1, 200)
    assert not nodes["/selected"].visible
    frame.show_camera(True)
    assert nodes["/selected"].visible


def test_a_frame_without_poses_has_no_camera_and_asks_for_no_picture(shown):
    frame, show, (first, _), drawer, nodes = shown
    show(first)
    assert "/selected" in nodes
    frame.show("walk", first, None, is_playing=True)
    assert "/selected" not in nodes
    assert len(drawer.asked) == 1
