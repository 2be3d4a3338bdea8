"""The app's colours: legible in light and dark, and told apart by eyes that do not see red and green as two hues."""

import itertools

import numpy as np
import pytest
import viser
from gazeloc_app import palette
from gazeloc_app.looks import set_theme
from gazeloc_app.scene_cameras import STATUS_COLORS
from viser._messages import ThemeConfigurationMessage

# Viénot, Brettel and Mollon 1999: what a deuteranope and a protanope see of linear sRGB.
DEUTERANOPE = np.array([[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]])
PROTANOPE = np.array([[0.11238, 0.88762, 0.0], [0.11238, 0.88762, 0.0], [0.00401, -0.00401, 1.0]])
XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
WHITE = XYZ.sum(axis=1)


def linear(rgb):
    value = np.asarray(rgb) / 255
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def contrast(a, b):
    """WCAG 2's ratio of luminances."""
    low, high = sorted(0.05 + XYZ[1] @ linear(color) for color in (a, b))
    return high / low


def lab(linear_rgb):
    ratio = XYZ @ np.clip(linear_rgb, 0, 1) / WHITE
    f = np.where(ratio > 0.008856, np.cbrt(ratio), 7.787 * ratio + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def apart(a, b, seen_by):
    return float(np.linalg.norm(lab(seen_by @ linear(a)) - lab(seen_by @ linear(b))))


@pytest.mark.parametrize("name", palette.TEXT_MEANINGS)
def test_words_are_legible_in_light_and_dark(name):
    light, dark = palette.shades(name)
    assert contrast(light, palette.PAPER) >= 4.5
    assert contrast(dark, palette.PAPER_DARK) >= 4.5
    assert contrast(light, palette.shades("card")[0]) >= 4.5
    assert contrast(dark, palette.shades("card")[1]) >= 4.5


def test_letters_are_legible_on_the_brands_colour_and_it_on_paper():
    assert contrast(palette.BRAND, (255, 255, 255)) >= 4.5
    assert contrast(palette.BRAND_DARK, (0, 0, 0)) >= 4.5
    assert contrast(palette.BRAND_DARK, palette.PAPER_DARK) >= 4.5
    assert palette.shades("brand") == (palette.BRAND, palette.BRAND_DARK)


@pytest.mark.parametrize(("is_dark", "shade", "brand"), [(False, 6, palette.BRAND), (True, 8, palette.BRAND_DARK)])
def test_visers_buttons_come_out_in_the_brands_colour(is_dark, shade, brand):
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        set_theme(server.gui, is_dark=is_dark)
        buffered = server._websock_server._broadcast_buffer.message_from_id.values()
        (theme,) = [message for message in buffered if isinstance(message, ThemeConfigurationMessage)]
    finally:
        server.stop()
    made = bytes.fromhex(theme.colors[shade][1:])
    assert np.abs(np.array(list(made)) - brand).max() <= 3


@pytest.mark.parametrize("eyes", [np.eye(3), DEUTERANOPE, PROTANOPE], ids=["three", "deuteranope", "protanope"])
def test_truth_estimate_and_phone_are_told_apart(eyes):
    for a, b in itertools.combinations((palette.TRUTH, palette.ESTIMATE, palette.PHONE), 2):
        assert apart(a, b, eyes) >= 30


def test_the_measure_knows_colours_that_are_confused():
    """Red and green of one lightness: what the palette must not be."""
    assert apart((215, 60, 40), (90, 130, 40), np.eye(3)) > 70
    assert apart((215, 60, 40), (90, 130, 40), DEUTERANOPE) < 25


@pytest.mark.parametrize("eyes", [DEUTERANOPE, PROTANOPE], ids=["deuteranope", "protanope"])
def test_statuses_are_told_apart(eyes):
    for a, b in itertools.combinations(STATUS_COLORS.values(), 2):
        assert apart(a, b, eyes) >= 20


def test_every_meaning_has_a_shade_for_the_dark():
    css = palette.css()
    for name in (*palette.TEXT_MEANINGS, "line", "card"):
        assert css.count(f"--gazeloc-{name}:") == 2
