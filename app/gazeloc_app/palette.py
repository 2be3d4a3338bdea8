"""Every colour of the app's own: its brand, what words and marks mean, and what is drawn in the scene and in charts.

Within each set, colours differ for protan, deutan and tritan eyes too, and from the ground in light and dark, mostly by
their lightness: tests/app/test_palette.py simulates these eyes. Ground truth is green and the estimate red, as in the
paper; people who would rather have two hues that they see as two switch to `SAFE`, blue and orange.
"""

from __future__ import annotations

import colorsys
from collections.abc import Mapping
from dataclasses import dataclass

from gazeloc_core.frames.marks import Mark
from gazeloc_core.methods import Method
from gazeloc_core.trajectory import PoseStatus

Rgb = tuple[int, int, int]

BRAND: Rgb = (28, 110, 140)
"""Of buttons and of the tab that is open."""
BRAND_DARK: Rgb = (84, 178, 214)
"""The same in the dark, where letters on it are black."""
UNDER: Rgb = (100, 106, 114)
"""Of the truth while the estimates' colours stand for something, its own among them."""
STATUSES: Mapping[PoseStatus, Rgb] = {
    PoseStatus.REGISTERED: (0, 114, 178),
    PoseStatus.TRACKED: (120, 240, 150),
    PoseStatus.INTERPOLATED: (235, 165, 0),
    PoseStatus.TAG_ONLY: (150, 0, 240),
    PoseStatus.REJECTED: (130, 0, 0),
    PoseStatus.NONE: (150, 150, 150),
}
MARKS: Mapping[Mark, Rgb] = {Mark.GOOD: (0, 114, 178), Mark.BAD: (150, 0, 0), Mark.UNSURE: (235, 165, 0)}
SCORE: Rgb = (28, 110, 140)
ERROR: Rgb = (210, 90, 30)
"""Of curves over the frames."""
SCAN_SIDE: Rgb = (255, 120, 0)
SFM_SIDE: Rgb = (0, 200, 255)
SELECTED: Rgb = (150, 0, 150)
DISABLED: Rgb = (120, 120, 120)
"""Of keypoints; in frames the first is for what was clicked, the second for where it is expected."""
RESIDUAL: Rgb = (220, 30, 40)
SCAN_TAGS: Rgb = (20, 120, 220)
SFM_TAGS: Rgb = (235, 130, 20)
FILTERED_OUT: Rgb = (120, 120, 120)
"""Points under a tag that the paper's filter drops."""
POINTS: Rgb = (90, 160, 220)
"""Points of a reconstruction without colours."""
SHOWN_FRAME: Rgb = (255, 200, 0)
GAZE: Rgb = (230, 60, 200)
"""In the scene, and as a ring in the frame."""
AIM: Rgb = (255, 0, 200)
"""Of the crosshairs of lens and loupe, on a white rim."""
TAPE: Rgb = (0, 190, 235)
GROUND: Rgb = (150, 158, 168)
AXES: tuple[Rgb, Rgb, Rgb] = ((213, 94, 0), (0, 158, 115), (0, 114, 178))
"""Of the grid, and of x, y and z."""
SERIES: tuple[Rgb, ...] = ((28, 110, 140), (210, 90, 30), (150, 30, 240), (90, 30, 0), (0, 240, 150), (240, 210, 0))
"""Of charts."""
PEOPLE = SERIES
"""By their numbers."""
CHART_TEXT: Rgb = (123, 135, 148)
"""Legible in light and dark."""
CHART_GRID = "rgba(136,136,136,0.3)"
CLEAR = "rgba(0,0,0,0)"
"""No colour, as charts want it."""


@dataclass(frozen=True)
class Cameras:
    """The colours of the sets of cameras, and the words for the first three."""

    truth: Rgb
    estimate: Rgb
    phone: Rgb
    methods: Mapping[Method, Rgb]
    """Of methods that are compared with the chosen one, which has the estimate's."""
    words: tuple[str, str, str]


USUAL = Cameras(
    truth=(60, 200, 130),
    estimate=(200, 20, 20),
    phone=(70, 110, 200),
    methods={
        Method.SFM: (120, 0, 240),
        Method.SFM_PAPER: (240, 150, 0),
        Method.TAGS: (150, 90, 120),
        Method.TAGS_PAPER: (60, 0, 90),
        Method.GLOBAL: (240, 180, 240),
    },
    words=("green", "red", "blue"),
)
SAFE = Cameras(
    truth=(0, 100, 180),
    estimate=(235, 140, 0),
    phone=(110, 110, 120),
    methods={
        Method.SFM: (150, 0, 240),
        Method.SFM_PAPER: (240, 210, 150),
        Method.TAGS: (0, 210, 240),
        Method.TAGS_PAPER: (120, 0, 0),
        Method.GLOBAL: (90, 0, 90),
    },
    words=("blue", "orange", "grey"),
)


def cameras(*, are_safe: bool) -> Cameras:
    """The colours in force."""
    return SAFE if are_safe else USUAL


def hexadecimal(color: Rgb) -> str:
    """E.g. "#c81414"."""
    return "#" + bytes(color).hex()


BACKGROUND: Rgb = (233, 236, 239)
"""Behind the scene, in the light."""
BACKGROUND_DARK: Rgb = (33, 37, 41)
PAPER: Rgb = (255, 255, 255)
"""Behind panels; viser's own."""
PAPER_DARK: Rgb = (36, 36, 36)

_MEANINGS: dict[str, tuple[str, str]] = {
    "brand": ("#1c6e8c", "#54b2d6"),
    "good": ("#23753a", "#69db7c"),
    "warning": ("#9c4d00", "#ffa94d"),
    "bad": ("#c92a2a", "#ff8787"),
    "muted": ("#66707a", "#a3adb7"),
    "line": ("#d5dade", "#495057"),
    "card": ("#eef5f8", "#1d3038"),
    "ink": ("#1f2933", "#e9ecef"),
    "on-brand": ("#ffffff", "#000000"),
    "hover": ("#1c6e8c24", "#54b2d62e"),
    "faint": ("#88888822", "#88888833"),
}
"""In the light and in the dark."""
_ON_PICTURES: dict[str, str] = {
    "aim": hexadecimal(AIM),
    "gaze": hexadecimal(GAZE),
    "light": "#ffffff",
    "dark": "#16191c",
    "veil": "#16191cd9",
    "shadow": "#00000080",
    "alarm": "#7a2e0e",
}
"""The same in light and dark: on frames and renders, behind them, and of the banner over the whole page."""
TEXT_MEANINGS = ("good", "warning", "bad", "muted")


def meaning(name: str) -> str:
    """A colour that means something, for style attributes; those of _MEANINGS follow the page into the dark."""
    assert name in _MEANINGS or name in _ON_PICTURES
    return f"var(--gazeloc-{name})"


def shades(name: str) -> tuple[Rgb, Rgb]:
    """The colour in the light and in the dark."""
    light, dark = _MEANINGS[name]
    return _rgb(light), _rgb(dark)


def _rgb(hexadecimal: str) -> Rgb:
    red, green, blue = bytes.fromhex(hexadecimal[1:])
    return red, green, blue


def theme_color(*, is_dark: bool) -> Rgb:
    """The colour to give viser so that its buttons come out in the brand's.

    It makes ten shades, by lightness, from 0.9 to the given one, which is the ninth. Mantine takes the seventh in the
    light and the ninth in the dark.
    """
    if is_dark:
        return BRAND_DARK
    hue, lightness, saturation = colorsys.rgb_to_hls(*(channel / 255 for channel in BRAND))
    red, green, blue = colorsys.hls_to_rgb(hue, 0.9 - (0.9 - lightness) * 8 / 6, saturation)
    return round(255 * red), round(255 * green), round(255 * blue)


def css() -> str:
    """The style sheet that defines all of them; Mantine, which viser is built with, marks the page that is dark."""
    light = "".join(f"--gazeloc-{name}:{values[0]};" for name, values in _MEANINGS.items())
    light += "".join(f"--gazeloc-{name}:{value};" for name, value in _ON_PICTURES.items())
    dark = "".join(f"--gazeloc-{name}:{values[1]};" for name, values in _MEANINGS.items())
    return f':root{{{light}}}\n:root[data-mantine-color-scheme="dark"]{{{dark}}}\n'
