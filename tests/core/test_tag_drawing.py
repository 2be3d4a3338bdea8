"""Drawings of tags are where the camera projects them, to a fraction of a pixel, and never change the picture given."""

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.camera import Camera
from gazeloc_core.tags.drawing import CUBE, FIRST_CORNER, OUTLINE, DrawingOptions, DrawnTag, draw_tags
from gazeloc_core.tags.square import UNIT_SQUARE

PINHOLE = Camera.pinhole(320, 240, 300, 300, 160, 120)
BENT = Camera("FULL_OPENCV", 320, 240, np.array([150, 150, 160, 120, 0.4, 0.2, 0, 0, 0, 0, 0, 0], float))
SIZE_M = 0.16
SQUARE = np.column_stack([UNIT_SQUARE, np.zeros(4)]) * SIZE_M
BARE = DrawingOptions(axes=False, cube=False, label=False)


def seen(camera: Camera, pose: RigidTransform, tag_id: int = 7, posed: bool = True) -> DrawnTag:
    return DrawnTag(tag_id, camera.project(pose.apply(SQUARE)), pose if posed else None)


def pose(z: float, *turn_deg: float) -> RigidTransform:
    return RigidTransform.from_components([0, 0.01, z], Rotation.from_euler("xyz", turn_deg, degrees=True))


def has_color(image: np.ndarray, pixel: np.ndarray, color: tuple[int, int, int]) -> bool:
    """Whether the colour is drawn at a pixel or at its neighbours."""
    x, y = np.floor(pixel).astype(int)
    near = image[y - 1 : y + 2, x - 1 : x + 2].astype(int)
    return bool((np.abs(near - np.array(color)).max(axis=2) < 60).any())


@pytest.mark.parametrize("at", [(80.25, 60.75), (80.5, 60.5), (80.0, 60.0)])
def test_the_first_corner_has_no_half_pixel(at: tuple[float, float]) -> None:
    """The middle of the drawn spot, in our convention, is the corner; OpenCV's would be off by half a pixel."""
    corners = np.array([at, (140, 61), (141, 20), (81, 20)], dtype=float)
    blank = np.zeros((120, 200, 3), np.uint8)
    drawn = draw_tags(blank, [DrawnTag(0, corners)], PINHOLE, None, DrawingOptions(label=False, width_px=3)).astype(int)
    magenta = np.minimum(drawn[..., 0], drawn[..., 2]) - drawn[..., 1]  # the white outline has none
    weight = np.clip(magenta, 0, None)
    y, x = np.mgrid[:120, :200] + 0.5
    middle = np.array([(x * weight).sum(), (y * weight).sum()]) / weight.sum()
    np.testing.assert_allclose(middle, at, atol=0.15)
    assert weight.max() >= FIRST_CORNER[2] - FIRST_CORNER[1] - 5


def test_outline_and_cube_are_where_the_camera_sees_them() -> None:
    at = pose(0.7, 40, -30, 10)
    image = draw_tags(np.full((240, 320, 3), 60, np.uint8), [seen(PINHOLE, at)], PINHOLE, SIZE_M)
    corners = PINHOLE.project(at.apply(SQUARE))
    for middle in (corners + np.roll(corners, 1, axis=0)) / 2:
        assert has_color(image, middle, OUTLINE)
    top = SQUARE - [0, 0, SIZE_M]
    for middle in PINHOLE.project(at.apply((top + np.roll(top, 1, axis=0)) / 2)):
        assert has_color(image, middle, CUBE)


def test_the_cube_bends_with_the_lens() -> None:
    at = pose(0.35, 0, 0, 0)
    image = draw_tags(np.zeros((240, 320, 3), np.uint8), [seen(BENT, at)], BENT, SIZE_M)
    a, b = at.apply(np.array([[0.08, -0.08, -SIZE_M], [0.08, 0.08, -SIZE_M]]))
    ends, middle = BENT.project(np.array([a, b])), BENT.project((a + b) / 2)[0]
    assert np.linalg.norm(middle - ends.mean(axis=0)) > 3
    assert has_color(image, middle, CUBE)
    assert not has_color(image, ends.mean(axis=0), CUBE)


def test_a_tag_without_pose_or_size_gets_no_cube() -> None:
    at = pose(1.0, 30, 0, 0)
    blank = np.zeros((240, 320, 3), np.uint8)
    plain = draw_tags(blank, [seen(PINHOLE, at, posed=False)], PINHOLE, SIZE_M)
    np.testing.assert_array_equal(plain, draw_tags(blank, [seen(PINHOLE, at)], PINHOLE, None))
    full = draw_tags(blank, [seen(PINHOLE, at)], PINHOLE, SIZE_M)
    assert (full != plain).any()


def test_the_picture_that_was_given_stays_as_it_was() -> None:
    given = np.full((240, 320, 3), 60, np.uint8)
    given.flags.writeable = False
    drawn = draw_tags(given, [seen(PINHOLE, pose(1.0, 0, 0, 0))], PINHOLE, SIZE_M)
    assert (given == 60).all()
    assert drawn.shape == given.shape
    np.testing.assert_array_equal(draw_tags(given, [], PINHOLE, SIZE_M), given)


def test_what_is_behind_the_camera_is_left_out() -> None:
    """A tag so near that its cube reaches behind the lens."""
    near = pose(0.1, 0, 0, 0)
    blank = np.zeros((240, 320, 3), np.uint8)
    drawn = draw_tags(blank, [seen(PINHOLE, near)], PINHOLE, SIZE_M)
    outline = draw_tags(blank, [seen(PINHOLE, near)], PINHOLE, SIZE_M, BARE)
    assert (drawn != outline).mean() < 0.2


def test_lines_show_on_dim_and_on_bright_pictures() -> None:
    """Across a line both something much darker and something much brighter than each other is drawn."""
    tag = seen(PINHOLE, pose(0.8, 0, 0, 0), posed=False)
    x, y = np.floor((tag.corners_px[0] + tag.corners_px[1]) / 2).astype(int)
    for grey in (5, 128, 250):
        drawn = draw_tags(np.full((240, 320, 3), grey, np.uint8), [tag], PINHOLE, None, BARE)
        across = drawn[y - 3 : y + 4, x].astype(int).mean(axis=1)
        assert across.max() - across.min() > 120


def test_labels_stay_inside_the_picture() -> None:
    tag = seen(PINHOLE, pose(0.45, 0, 0, 0), tag_id=123)
    low = DrawnTag(123, tag.corners_px + np.array([150, 118]))  # its lower edge is below the picture
    blank = np.zeros((240, 320, 3), np.uint8)
    named = draw_tags(blank, [low], PINHOLE, None)
    bare = draw_tags(blank, [low], PINHOLE, None, BARE)
    rows, columns = np.nonzero((named != bare).any(axis=2))
    assert len(rows) > 40
    assert columns.min() > 0
    assert columns.max() < 319
    assert rows.max() < 239
