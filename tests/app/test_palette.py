"""The app's colours: legible in light and dark, and told apart by eyes that do not see red and green as two hues."""

import itertools
import re
from pathlib import Path

import numpy as np
import pytest
import viser
from gazeloc_app import palette
from gazeloc_app.looks import set_theme
from gazeloc_app.plots import to_plotly
from viser._messages import ThemeConfigurationMessage

from gazeloc_core.charts.values import Chart, Series
from gazeloc_core.frames.marks import Mark
from gazeloc_core.methods import Method
from gazeloc_core.resources import static_files
from gazeloc_core.tags import drawing
from gazeloc_core.trajectory import PoseStatus

# Machado, Oliveira and Fernandes 2009, severity 1: what eyes without one kind of cone see of linear sRGB.
EYES = {
    "usual": np.eye(3),
    "protan": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deutan": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "tritan": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}


def _cameras_of(one):
    return one.truth, one.estimate, one.phone, *one.methods.values()


SETS = {
    "usual cameras": _cameras_of(palette.USUAL),
    "safe cameras": _cameras_of(palette.SAFE),
    "statuses": tuple(palette.STATUSES.values()),
    "marks": tuple(palette.MARKS.values()),
    "keypoints": (palette.SCAN_SIDE, palette.SFM_SIDE, palette.SELECTED, palette.DISABLED),
    "tags": (palette.SCAN_TAGS, palette.SFM_TAGS),
    "curves": (palette.SCORE, palette.ERROR),
    "series": palette.SERIES,
}
APART, FROM_THE_GROUND = 24, 18
"""CIE 1976 colour differences: 2 is just seen side by side, 10 at a glance."""
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


@pytest.mark.parametrize("eyes", EYES)
@pytest.mark.parametrize("name", SETS)
def test_the_colours_of_a_set_are_told_apart_by_all_eyes(name, eyes):
    for a, b in itertools.combinations(SETS[name], 2):
        assert apart(a, b, EYES[eyes]) >= APART, (a, b)


@pytest.mark.parametrize("eyes", EYES)
@pytest.mark.parametrize("name", SETS)
def test_every_colour_stands_out_from_the_ground_in_light_and_dark(name, eyes):
    for color, ground in itertools.product(SETS[name], (palette.BACKGROUND, palette.BACKGROUND_DARK)):
        assert apart(color, ground, EYES[eyes]) >= FROM_THE_GROUND, (color, ground)


def test_colour_blind_eyes_see_truth_and_estimate_as_two_hues_in_the_safe_set():
    """In the usual set they are one hue, told apart by lightness."""
    for eyes in ("protan", "deutan"):
        hues = [lab(EYES[eyes] @ linear(color))[1:] for color in (palette.SAFE.truth, palette.SAFE.estimate)]
        assert np.dot(*hues) < 0
        usual = [lab(EYES[eyes] @ linear(color))[1:] for color in (palette.USUAL.truth, palette.USUAL.estimate)]
        assert np.dot(*usual) > 0


def test_the_simulation_leaves_grey_grey_and_confuses_what_such_eyes_confuse():
    for eyes in EYES.values():
        np.testing.assert_allclose(eyes.sum(axis=1), 1, atol=1e-5)
    assert apart((215, 60, 40), (90, 130, 40), EYES["usual"]) > 70
    assert apart((215, 60, 40), (110, 100, 40), EYES["deutan"]) < 25
    assert apart((0, 150, 150), (215, 60, 175), EYES["deutan"]) < 15, "two methods' colours until this was tested"


def test_every_status_mark_and_method_has_a_colour_and_charts_use_the_series():
    assert set(palette.STATUSES) == set(PoseStatus)
    assert set(palette.MARKS) == set(Mark)
    assert set(palette.USUAL.methods) == set(palette.SAFE.methods) == set(Method)
    chart = Chart("t", "x", "y", tuple(Series(str(n), [0.0, 1.0], [0.0, 1.0]) for n in range(7)))
    colors = [trace.line.color for trace in to_plotly(chart).data]
    assert colors[:6] == [palette.hexadecimal(color) for color in palette.SERIES]
    assert colors[6] == colors[0]


def test_every_meaning_has_a_shade_for_the_dark():
    css = palette.css()
    for name in (*palette.TEXT_MEANINGS, "line", "card"):
        assert css.count(f"--gazeloc-{name}:") == 2


def test_letters_are_legible_on_pictures_buttons_and_the_banner():
    light, dark, alarm = (on_pictures(name) for name in ("light", "dark", "alarm"))
    assert contrast(light, dark) >= 7
    assert contrast(light, alarm) >= 7
    assert min(contrast(palette.shades(name)[0], light) for name in ("muted", "bad")) >= 4.5, "grey and red buttons"
    assert on_pictures("veil") == dark, "and nearly opaque, so that it is as good a ground"
    for paper, ink, brand, on_brand in zip(
        (palette.PAPER, palette.PAPER_DARK),
        *(palette.shades(name) for name in ("ink", "brand", "on-brand")),
        strict=True,
    ):
        assert contrast(ink, paper) >= 7
        assert contrast(on_brand, brand) >= 4.5


@pytest.mark.parametrize("eyes", EYES)
def test_the_gaze_is_told_from_keypoints_in_a_frame_by_its_colour_and_being_a_ring(eyes):
    for color in (palette.SCAN_SIDE, palette.SFM_SIDE, palette.SELECTED):
        assert apart(palette.GAZE, color, EYES[eyes]) >= FROM_THE_GROUND - 1


@pytest.mark.parametrize("eyes", EYES)
def test_what_is_drawn_of_a_tag_is_told_apart_and_shows_on_its_dark_rim(eyes):
    colors = (drawing.OUTLINE, drawing.CUBE, drawing.FIRST_CORNER, *drawing.AXES)
    for a, b in itertools.combinations(colors, 2):
        is_dot_and_line = {a, b} == {drawing.FIRST_CORNER, drawing.AXES[2]}
        assert is_dot_and_line or apart(a, b, EYES[eyes]) >= APART, (a, b)
    assert min(contrast(color, drawing._RIM) for color in colors) >= 3


@pytest.mark.parametrize("eyes", EYES)
def test_the_crosshair_shows_on_any_picture_by_itself_or_by_its_rim(eyes):
    for grey in range(0, 256, 15):
        ground = (grey, grey, grey)
        assert max(apart(color, ground, EYES[eyes]) for color in (palette.AIM, on_pictures("light"))) >= 25


def test_no_colour_of_the_page_or_its_panels_is_written_elsewhere():
    app = Path(palette.__file__).parent
    files = [path for path in static_files("page") if path.suffix in (".css", ".js")]
    files += [path for path in app.rglob("*.py") if path.name != "palette.py"]
    literal = re.compile(r"""[\s"':(]#(?:[0-9a-fA-F]{3,4}|[0-9a-fA-F]{6}|[0-9a-fA-F]{8})\b|\brgba?\(\d|\bhsla?\(\d""")
    found = [f"{path.name}: {match.group()}" for path in files for match in literal.finditer(path.read_text())]
    assert not found
    assert literal.search("color: #fff")
    assert literal.search("rgba(0,0,0")


def on_pictures(name):
    return palette._rgb(palette._ON_PICTURES[name][:7])
