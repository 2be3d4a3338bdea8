"""Tags rendered at known sub-pixel places, the hand-made list of a real bedroom, and tags that lie."""

import ctypes

import cv2
import numpy as np
import pytest
from bedroom import search_bedroom
from data import SHARED, needs_shared
from pyapriltags.apriltags import Detector, _image_u8_get_array, _ImageU8

from gazeloc_core.errors import Cancelled, InputError
from gazeloc_core.tags.detection import FAMILIES, TagDetector, TagOptions, detect_tags, hamming_of, memory_note

UPRIGHT = np.array([[0, 1], [1, 1], [1, 0], [0, 0]])  # tag_types.py: lower left, lower right, upper right, upper left


def printed(family: str, tag_id: int) -> tuple[np.ndarray, int]:
    """The tag's official picture, one pixel per bit, and how many bits lie outside of the reported square per side."""
    library = Detector(families="").libc
    library.apriltag_to_image.restype = ctypes.POINTER(_ImageU8)
    description = getattr(library, f"{family}_create")()
    picture = library.apriltag_to_image(description, tag_id)
    bits = _image_u8_get_array(picture)[:, : picture.contents.width].copy()
    return bits, (description.contents.total_width - description.contents.width_at_border) // 2


def draw(canvas: np.ndarray, family: str, tag_id: int, corners: np.ndarray) -> np.ndarray:
    """`canvas` (grey, float) with a tag whose detectable corners (4, 2) are put at exact places; 8x8 rays per pixel."""
    bits, outside = printed(family, tag_id)
    n, rays = len(bits), 8
    square = outside + UPRIGHT * (n - 2 * outside)
    bits_from_px = cv2.getPerspectiveTransform(corners.astype(np.float32), square.astype(np.float32))
    height, width = canvas.shape
    y, x = (np.mgrid[0 : height * rays, 0 : width * rays] + 0.5) / rays
    u, v, w = np.tensordot(bits_from_px, np.stack([x, y, np.ones_like(x)]), axes=1)
    u, v = u / w, v / w
    inside = (u >= 0) & (u < n) & (v >= 0) & (v < n)
    value = bits[np.clip(v, 0, n - 1).astype(int), np.clip(u, 0, n - 1).astype(int)] * 0.7 + 20
    shown = np.where(inside, value, np.kron(canvas, np.ones((rays, rays))))
    return shown.reshape(height, rays, width, rays).mean(axis=(1, 3))


def finish(canvas: np.ndarray, seed: int = 0) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(0, 2, canvas.shape)
    return np.clip(cv2.GaussianBlur(canvas, (0, 0), 0.7) + noise, 0, 255).astype(np.uint8)


@pytest.mark.parametrize("decimate", [1.0, 2.0])
def test_corners_have_no_half_pixel_and_come_in_the_drawn_order(decimate: float) -> None:
    rng = np.random.default_rng(0)
    errors = []
    with TagDetector(TagOptions(quad_decimate=decimate)) as detector:
        for tag_id in range(8):
            corners = 40 + UPRIGHT * 80 + rng.uniform(-7, 7, (4, 2)) + rng.uniform(0, 20, 2)
            image = finish(draw(np.full((200, 200), 200.0), "tag36h11", tag_id, corners), tag_id)
            seen = detector.detect(np.repeat(image[..., None], 3, axis=2))
            assert seen.tag_id.tolist() == [tag_id]
            errors.append(seen.corners_px[0] - corners)
    bias = np.mean(errors, axis=(0, 1))
    assert np.abs(bias).max() < 0.05  # the other convention would show as 0.5
    assert np.sqrt(np.mean(np.square(errors))) < 0.1


@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_is_found_at_the_place_of_its_reported_square(family: str) -> None:
    corners = 60 + UPRIGHT * 80.0
    image = finish(draw(np.full((200, 200), 200.0), family, 7, corners))
    with TagDetector(TagOptions(family=family)) as detector:
        seen = detector.detect(image)
    assert seen.tag_id.tolist() == [7]
    np.testing.assert_allclose(seen.corners_px[0], corners, atol=0.3)


def test_an_id_printed_twice_is_left_out_and_the_others_stay() -> None:
    canvas = np.full((160, 360), 200.0)
    for tag_id, x in ((3, 20), (3, 130), (4, 240)):
        canvas = draw(canvas, "tag36h11", tag_id, np.array([x, 40]) + UPRIGHT * 80.0)
    with TagDetector() as detector:
        assert detector.detect(finish(canvas)).tag_id.tolist() == [4]


def test_a_tag_at_the_edge_of_the_picture_is_left_out() -> None:
    image = finish(draw(np.full((160, 160), 200.0), "tag36h11", 3, np.array([30, 40]) + UPRIGHT * 80.0))
    with TagDetector() as usual, TagDetector(TagOptions(border_px=35)) as strict:
        assert len(usual.detect(image)) == 1
        assert len(strict.detect(image)) == 0


def test_noise_holds_no_tags() -> None:
    rng = np.random.default_rng(5)
    for family in ("tag36h11", "tag16h5"):
        frames = ((i, rng.integers(0, 255, (240, 320, 3), dtype=np.uint8)) for i in range(10))
        assert len(detect_tags(frames, 10, TagOptions(family=family))) == 0


def test_sightings_carry_the_frames_own_indices() -> None:
    image = finish(draw(np.full((160, 160), 200.0), "tag36h11", 3, np.array([30, 40]) + UPRIGHT * 80.0))
    blank = np.full_like(image, 90)
    sightings = detect_tags([(7, image), (9, blank), (12, image)], 3)
    assert sightings.frame_index.tolist() == [7, 12]
    assert sightings.tag_id.tolist() == [3, 3]


def test_no_frames_give_no_sightings() -> None:
    assert len(detect_tags([], 0)) == 0


def test_cancelling_passes_through() -> None:
    def report(fraction: float, text: str = "", /) -> None:
        if fraction > 0:
            raise Cancelled("stop")

    with pytest.raises(Cancelled):
        detect_tags([(0, np.zeros((50, 50), np.uint8))], 1, report=report)


def test_large_families_take_little_memory_unless_asked_to() -> None:
    for name, family in FAMILIES.items():
        assert (hamming_of(TagOptions(family=name)) < 2) or family.memory_of_two_mb < 1000
        assert memory_note(TagOptions(family=name)) is None
    assert "7.2 GB" in str(memory_note(TagOptions(family="tagCircle49h12", max_hamming=2)))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (TagOptions(family="tag36h10"), "tag36h10"),
        (TagOptions(max_hamming=3), "0, 1 or 2"),
        (TagOptions(quad_decimate=0.0), "decimate by 0"),
    ],
)
def test_impossible_options_are_refused(options: TagOptions, words: str) -> None:
    with pytest.raises(InputError, match=words):
        TagDetector(options)


@needs_shared
def test_the_bedroom_of_the_hand_made_list() -> None:
    seen = search_bedroom(SHARED / "swatbotics_room_B")
    assert seen.listed == 135  # the list was read whole
    assert seen.recall >= 0.94
    assert seen.false == 0
