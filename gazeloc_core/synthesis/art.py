"""Pictures for walls, spines, pages and the view out of the window: sRGB images painted from a seed."""

from __future__ import annotations

import cv2
import numpy as np

from gazeloc_core.arrays import Bytes, Floats
from gazeloc_core.synthesis.textures import noise

PALETTES = (
    ((236, 226, 204), (196, 72, 48), (32, 58, 86), (228, 168, 62), (70, 118, 112)),
    ((242, 236, 224), (28, 34, 48), (206, 92, 68), (134, 160, 158), (232, 196, 120)),
    ((228, 234, 230), (44, 84, 74), (214, 150, 80), (170, 60, 64), (96, 130, 168)),
)


def _blend(image: Floats, mask: Floats, color: tuple[int, int, int]) -> None:
    image += mask[..., None] * (np.array(color, dtype=np.float64) - image)


def _finish(image: Floats, seed: int) -> Bytes:
    height, width = image.shape[:2]
    y, x = np.mgrid[:height, :width] / 6.0
    return np.asarray(np.clip(image * (1 + 0.05 * noise(x, y, seed, 3)[..., None]), 0, 255), dtype=np.uint8)


def landscape(width: int, height: int, seed: int) -> Bytes:
    """Layered hills under a low sun."""
    rng = np.random.default_rng(seed)
    paper, warm, dark, sun, cool = PALETTES[seed % len(PALETTES)]
    y, x = np.mgrid[:height, :width].astype(np.float64)
    fall = (y / height)[..., None]
    image = (1 - fall) * np.array(cool) * 0.5 + (1 - fall) * np.array(paper) * 0.5 + fall * np.array(sun)
    away = np.hypot(x - width * rng.uniform(0.3, 0.7), y - height * 0.36)
    _blend(image, np.clip(height * 0.11 - away, 0, 1), warm)
    for layer in range(5):
        ridge = height * (0.42 + 0.12 * layer) + height * 0.09 * noise(x / width * 3, x * 0 + layer, seed + layer, 5)
        share = layer / 4
        color = (1 - share) * np.array(cool) + share * np.array(dark)
        _blend(image, np.clip(y - ridge, 0, 1), (int(color[0]), int(color[1]), int(color[2])))
    return _finish(image, seed)


def blocks(width: int, height: int, seed: int) -> Bytes:
    """A grid of coloured rectangles with black bars."""
    rng = np.random.default_rng(seed)
    image = np.full((height, width, 3), PALETTES[seed % 3][0], dtype=np.uint8)
    xs = np.sort(rng.integers(0, width, 5)).tolist()
    ys = np.sort(rng.integers(0, height, 6)).tolist()
    xs, ys = [0, *xs, width], [0, *ys, height]
    for i in range(len(ys) - 1):
        for j in range(len(xs) - 1):
            color = PALETTES[seed % 3][int(rng.choice(5, p=(0.44, 0.16, 0.14, 0.14, 0.12)))]
            cv2.rectangle(image, (xs[j], ys[i]), (xs[j + 1], ys[i + 1]), color, -1)
            cv2.rectangle(image, (xs[j], ys[i]), (xs[j + 1], ys[i + 1]), (24, 24, 26), max(2, width // 70))
    return _finish(image.astype(np.float64), seed)


def circles(width: int, height: int, seed: int) -> Bytes:
    """Overlapping discs, arcs and lines on paper."""
    rng = np.random.default_rng(seed)
    colors = PALETTES[seed % 3]
    image = np.full((height, width, 3), colors[0], dtype=np.float64)
    y, x = np.mgrid[:height, :width].astype(np.float64)
    for k in range(14):
        cx, cy = rng.uniform(0.1, 0.9) * width, rng.uniform(0.1, 0.9) * height
        radius, color = rng.uniform(0.05, 0.24) * width, colors[1 + int(rng.integers(4))]
        away = np.hypot(x - cx, y - cy)
        mask = np.clip(radius - away, 0, 1)
        if k % 3 == 1:
            mask = np.clip(width * 0.012 - np.abs(away - radius), 0, 1)
        _blend(image, mask * (0.9 if k % 2 else 0.75), color)
    for _ in range(6):
        a, offset = rng.uniform(0, np.pi), rng.uniform(0.2, 0.8) * width
        line = np.abs(np.cos(a) * (x - offset) + np.sin(a) * (y - offset))
        _blend(image, np.clip(width * 0.006 - line, 0, 1), (30, 32, 40))
    return _finish(image, seed)


def contours(width: int, height: int, seed: int) -> Bytes:
    """Level lines of a made-up map in one ink, with tinted heights."""
    colors = PALETTES[seed % 3]
    y, x = np.mgrid[:height, :width] / width
    level = 9 * noise(x * 2.6, y * 2.6, seed, 4) + 9
    image = np.full((height, width, 3), colors[0], dtype=np.float64)
    for step, color in ((9, colors[4]), (11, colors[3]), (13, colors[1])):
        _blend(image, np.clip((level - step) * 4, 0, 0.6), color)
    _blend(image, np.clip(1 - np.abs(level - np.rint(level)) * 9, 0, 1), colors[2])
    return _finish(image, seed)


def page(width: int, height: int, seed: int) -> Bytes:
    """A printed page: title, lines of words, a small figure."""
    rng = np.random.default_rng(seed)
    image = np.full((height, width, 3), (238, 236, 228), dtype=np.uint8)
    y, margin = height // 10, width // 9
    cv2.rectangle(image, (margin, y), (margin + width // 2, y + height // 30), (40, 42, 60), -1)
    y += height // 12
    while y < height * 0.9:
        if 0.45 < y / height < 0.62 and seed % 2:
            cv2.rectangle(image, (margin, y), (width - margin, y + height // 6), PALETTES[seed % 3][4], -1)
            y += height // 5
            continue
        x = margin
        while x < width - margin:
            word = int(rng.integers(width // 40 + 2, width // 9 + 3))
            cv2.rectangle(image, (x, y), (min(x + word, width - margin), y + max(1, height // 110)), (70, 70, 74), -1)
            x += word + width // 36 + 1
        y += height // 38
    return np.asarray(image, dtype=np.uint8)


def spine(width: int, height: int, seed: int) -> Bytes:
    """The back of a book: colour, bands, and marks that read as a title from afar."""
    rng = np.random.default_rng(seed)
    shades = np.array(
        [(150, 48, 44), (36, 66, 104), (58, 96, 74), (206, 178, 120), (66, 52, 74), (214, 206, 190), (190, 112, 50)]
    )
    base = shades[rng.integers(len(shades))] * rng.uniform(0.75, 1.1)
    image = np.clip(np.ones((height, width, 3)) * base, 0, 255).astype(np.uint8)
    ink = (238, 226, 190) if base.mean() < 140 else (50, 44, 52)
    for at in rng.uniform(0.04, 0.96, int(rng.integers(1, 4))):
        y = int(at * height)
        cv2.rectangle(image, (0, y), (width, y + max(1, height // 60)), ink, -1)
    y, stop = int(height * 0.18), int(height * rng.uniform(0.5, 0.75))
    while y < stop:
        letter = int(rng.integers(max(2, height // 40), max(4, height // 18)))
        inset = int(width * rng.uniform(0.22, 0.34))
        cv2.rectangle(image, (inset, y), (width - inset, y + letter), ink, -1)
        y += letter + max(2, height // 60)
    return np.asarray(image, dtype=np.uint8)


def garden(width: int, height: int, seed: int) -> Bytes:
    """The view out of the window: sky, clouds, far hills, soft trees."""
    y, x = np.mgrid[:height, :width].astype(np.float64)
    fall = np.clip(y / (height * 0.7), 0, 1)[..., None]
    image = (1 - fall) * np.array((150, 192, 236.0)) + fall * np.array((232, 240, 246.0))
    cloud = np.clip(noise(x / width * 3, y / height * 4, seed, 5) * 2.2, 0, 1)
    _blend(image, cloud * 0.8, (250, 250, 252))
    for layer, color in enumerate(((150, 178, 176), (116, 152, 122), (86, 128, 84))):
        lumps = noise(x / width * (3 + 5 * layer), x * 0 + 9 * layer, seed + layer, 5)
        _blend(image, np.clip((y - height * (0.62 + 0.11 * layer - 0.09 * lumps)) / 3, 0, 1), color)
    return np.asarray(cv2.GaussianBlur(np.clip(image, 0, 255).astype(np.uint8), (0, 0), width / 250), dtype=np.uint8)
