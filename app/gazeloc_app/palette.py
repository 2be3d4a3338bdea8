"""Every colour of the app's own: its brand, what words and marks mean, and the sets of cameras in the scene.

Ground truth is green and the estimate red, as in the paper. Eyes that do not tell the two hues apart tell them by their
lightness: truth is light, the estimate dark. tests/app/test_palette.py holds that, and that text is legible in
light and dark.
"""

from __future__ import annotations

import colorsys

Rgb = tuple[int, int, int]

BRAND: Rgb = (28, 110, 140)
"""Of buttons and of the tab that is open."""
BRAND_DARK: Rgb = (84, 178, 214)
"""The same in the dark, where letters on it are black."""
TRUTH: Rgb = (60, 200, 130)
ESTIMATE: Rgb = (200, 20, 20)
PHONE: Rgb = (70, 110, 200)
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
}
"""In the light and in the dark."""
TEXT_MEANINGS = ("good", "warning", "bad", "muted")


def meaning(name: str) -> str:
    """A colour that means something, for style attributes: it follows the page into the dark."""
    assert name in _MEANINGS
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
    dark = "".join(f"--gazeloc-{name}:{values[1]};" for name, values in _MEANINGS.items())
    return f':root{{{light}}}\n:root[data-mantine-color-scheme="dark"]{{{dark}}}\n'
