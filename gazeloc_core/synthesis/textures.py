"""Procedural materials: paints that give the linear albedo at x to the right and y down in metres.

Colours are written as sRGB, 0 to 255, as a painter would name them, and turned to linear light here.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike

from gazeloc_core.arrays import Bytes, Floats
from gazeloc_core.synthesis.geometry import Paint

LATTICE = 128


def linear(srgb: ArrayLike) -> Floats:
    """Linear light, 0 to 1, of sRGB values, 0 to 255 (IEC 61966-2-1)."""
    s = np.asarray(srgb, dtype=np.float64) / 255
    return np.asarray(np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4))


def noise(x: Floats, y: Floats, seed: int, octaves: int = 4) -> Floats:
    """Smooth value noise between -1 and 1 with features of about one unit, each octave half as large and strong."""
    table = np.random.default_rng(seed).uniform(-1, 1, (LATTICE, LATTICE))
    total, weight = np.zeros(np.broadcast(x, y).shape), 0.0
    for octave in range(octaves):
        px, py = x * 2**octave + 17.3 * octave, y * 2**octave + 5.1 * octave
        i, j = np.floor(py).astype(int), np.floor(px).astype(int)
        a, b = py - i, px - j
        a, b = a * a * (3 - 2 * a), b * b * (3 - 2 * b)
        upper = (1 - b) * table[i % LATTICE, j % LATTICE] + b * table[i % LATTICE, (j + 1) % LATTICE]
        lower = (1 - b) * table[(i + 1) % LATTICE, j % LATTICE] + b * table[(i + 1) % LATTICE, (j + 1) % LATTICE]
        total += 0.5**octave * ((1 - a) * upper + a * lower)
        weight += 0.5**octave
    return np.asarray(total / weight)


def shaded(srgb: ArrayLike, factor: Floats) -> Floats:
    """A colour times a brightness field, kept a possible albedo."""
    return np.asarray(np.clip(linear(srgb) * factor[..., None], 0, 0.95))


def plain(srgb: ArrayLike, seed: int = 0, mottle: float = 0.05) -> Paint:
    """A colour with faint large and small irregularities, like painted wood or plastic."""

    def paint(x: Floats, y: Floats) -> Floats:
        return shaded(srgb, 1 + mottle * noise(x * 6, y * 6, seed) + mottle * noise(x * 60, y * 60, seed + 1, 2))

    return paint


def wall(srgb: ArrayLike, seed: int) -> Paint:
    """Rolled paint on plaster: clouds, orange peel, and a few small scuffs lower down."""

    def paint(x: Floats, y: Floats) -> Floats:
        clouds = 0.022 * noise(x * 1.3, y * 1.3, seed, 3)
        peel = 0.03 * noise(x * 55, y * 55, seed + 1, 2)
        scuffs = np.clip(noise(x * 14, y * 9, seed + 2, 3) - 0.52, 0, 1) * np.clip(y / 2.6, 0.25, 1)
        return shaded(srgb, 1 + clouds + peel - 0.7 * scuffs)

    return paint


def wood(srgb: ArrayLike, seed: int, along_x: bool = True, contrast: float = 0.22) -> Paint:
    """Wood with its grain along x (or y)."""

    def paint(x: Floats, y: Floats) -> Floats:
        along, across = (x, y) if along_x else (y, x)
        wave = across * 42 + 1.6 * noise(along * 1.1, across * 7, seed, 3)
        rings = 0.5 + 0.5 * np.sin(wave * 3.1 + 2.5 * noise(along * 2.2, across * 16, seed + 1, 2))
        pores = noise(along * 16, across * 330, seed + 2, 2)
        tone = 1 + contrast * (rings - 0.5) + 0.6 * contrast * pores + 0.1 * noise(along, across * 3, seed + 3, 2)
        return shaded(srgb, tone)

    return paint


def plank_floor(seed: int) -> Paint:
    """Oak planks, 14 cm by 1.3 m, staggered, each of its own tone."""

    def paint(x: Floats, y: Floats) -> Floats:
        width, length = 0.14, 1.3
        row = np.floor(y / width).astype(int)
        shift = np.random.default_rng(seed).uniform(0, length, 400)[row % 400]
        column = np.floor((x + shift) / length).astype(int)
        number = (row * 37 + column * 101) % 997
        tones = np.random.default_rng(seed + 1)
        tone = tones.uniform(0.74, 1.16, 997)[number]
        warm = tones.uniform(-1, 1, 997)[number]
        grain = wood((178, 132, 88), seed + 2, contrast=0.3)(x + number * 3.7, y + number * 0.61)
        to_seam = np.minimum(np.mod(y, width), width - np.mod(y, width))
        to_end = np.minimum(np.mod(x + shift, length), length - np.mod(x + shift, length))
        seam = np.clip(np.minimum(to_seam, to_end) / 0.004, 0.35, 1)
        tint = 1 + warm[..., None] * np.array([0.05, 0.0, -0.08])
        return np.asarray(np.clip(grain * (tone * seam)[..., None] * tint, 0, 0.95))

    return paint


def fabric(srgb: ArrayLike, seed: int, stripes: ArrayLike | None = None, period_m: float = 0.06) -> Paint:
    """Woven cloth; with `stripes` of a second colour."""

    def paint(x: Floats, y: Floats) -> Floats:
        weave = 0.09 * np.sin(x * 900) * np.sin(y * 900) + 0.13 * noise(x * 130, y * 130, seed, 2)
        color = shaded(srgb, 1 + weave + 0.12 * noise(x * 5, y * 5, seed + 1, 3))
        if stripes is None:
            return color
        other = shaded(stripes, 1 + weave)
        band = (np.mod(x + 0.004 * noise(x * 9, y * 9, seed + 2, 1), period_m) < period_m * 0.42)[..., None]
        return np.asarray(np.where(band, other, color))

    return paint


def rug(width_m: float, height_m: float, seed: int) -> Paint:
    """A woven rug: borders, and a field of nested diamonds."""
    colors = linear([(142, 46, 42), (226, 208, 176), (38, 58, 92), (196, 138, 62), (92, 106, 84)])

    def paint(x: Floats, y: Floats) -> Floats:
        border = np.minimum(np.minimum(x, width_m - x), np.minimum(y, height_m - y))
        cell = 0.34
        across, along = np.mod(x - width_m / 2, cell) / cell - 0.5, np.mod(y - height_m / 2, cell) / cell - 0.5
        ring = np.floor((np.abs(across) + np.abs(along)) * 7).astype(int)
        number = np.floor((x - width_m / 2) / cell).astype(int) + 2 * np.floor((y - height_m / 2) / cell).astype(int)
        field = np.array([0, 3, 1, 2, 0, 4, 0, 0])[(ring + (number % 3) * (ring < 3)) % 8]
        zigzag = np.abs(np.mod(x + y, 0.08) - 0.04) < 0.018
        index = np.where(border < 0.17, np.where(zigzag, 3, 2), field)
        index = np.where((border < 0.03) | ((border > 0.15) & (border < 0.17)), 1, index)
        thread = 1 + 0.16 * noise(x * 170, y * 170, seed, 2) + 0.10 * noise(x * 4, y * 4, seed + 1, 3)
        return np.asarray(np.clip(colors[index] * thread[..., None], 0, 0.95))

    return paint


def picture(image: Bytes, width_m: float, height_m: float) -> Paint:
    """An sRGB image (H, W, 3) stretched over a patch of that size."""
    values = linear(image).astype(np.float32)
    rows, columns = values.shape[:2]

    def paint(x: Floats, y: Floats) -> Floats:
        px = (x / width_m * columns - 0.5).astype(np.float32)
        py = (y / height_m * rows - 0.5).astype(np.float32)
        found = cv2.remap(values, px, py, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(found, dtype=np.float64)

    return paint


def leaf_green(seed: int, width_m: float) -> Paint:
    """A leaf with a light midrib and veins."""

    def paint(x: Floats, y: Floats) -> Floats:
        off = np.abs(x - width_m / 2)
        veins = 0.2 * (np.sin((y - off) * 240) > 0.86)
        rib = 0.55 * (off < 0.0035)
        return shaded((66, 116, 58), 1 + veins + rib + 0.2 * noise(x * 30, y * 30, seed, 3))

    return paint
