"""Furniture of a made-up room, each piece about its own origin on the floor, its front towards +z."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gazeloc_core.synthesis import art
from gazeloc_core.synthesis.geometry import Paint, Patch, box, disc, lathe, leaf, moved, pillow, quad
from gazeloc_core.synthesis.textures import fabric, leaf_green, picture, plain, wood

OAK, WALNUT, WHITE = (196, 154, 108), (112, 76, 50), (228, 224, 214)
SAGE, OCHRE, RUST, NAVY, SAND = (124, 138, 116), (206, 152, 66), (176, 84, 56), (46, 62, 92), (206, 192, 166)


def sofa(width: float, seed: int) -> list[Patch]:
    """A sofa with arms, seat and back cushions, and throw pillows."""
    cloth = fabric((118, 132, 134), seed)
    base = box("sofa.base", (-width / 2, 0.1, -0.42), (width / 2, 0.3, 0.4), cloth)
    for x in (-width / 2 + 0.08, width / 2 - 0.16):
        for z in (-0.38, 0.3):
            base += box("sofa.leg", (x, 0, z), (x + 0.06, 0.1, z + 0.06), wood(WALNUT, seed))
    for side in (-1.0, 1.0):
        arm = pillow("sofa.arm", (0.2, 0.4, 0.84), cloth, 0.25)
        base.append(arm.moved(Rotation.identity(), (side * (width / 2 - 0.1), 0.42, -0.01)))
    half = (width - 0.4) / 2
    for side in (-0.5, 0.5):
        seat = pillow("sofa.seat", (half - 0.01, 0.2, 0.66), cloth, 0.3)
        base.append(seat.moved(Rotation.identity(), (side * half, 0.38, 0.1)))
        back = pillow("sofa.back", (half - 0.01, 0.5, 0.22), cloth, 0.35)
        base.append(back.moved(Rotation.from_euler("x", -9, degrees=True), (side * half, 0.66, -0.26)))
    throws: list[tuple[float, Paint, float]] = [
        (-0.62, fabric(OCHRE, seed + 3), 14),
        (-0.28, fabric(SAND, seed + 4, stripes=NAVY, period_m=0.05), -9),
        (0.62, fabric(RUST, seed + 5, stripes=(222, 202, 170), period_m=0.09), -16),
    ]
    for x, paint, roll in throws:
        soft = pillow("sofa.pillow", (0.4, 0.4, 0.17), paint, 0.55)
        base.append(soft.moved(Rotation.from_euler("xz", (-20, roll), degrees=True), (x, 0.66, -0.06)))
    return base


def table(width: float, depth: float, height: float, color: tuple[int, int, int], seed: int) -> list[Patch]:
    """A table on four legs."""
    top = wood(color, seed)
    parts = box("table.top", (-width / 2, height - 0.035, -depth / 2), (width / 2, height, depth / 2), top)
    for x in (-width / 2 + 0.03, width / 2 - 0.08):
        for z in (-depth / 2 + 0.03, depth / 2 - 0.08):
            leg = wood(color, seed + 1, along_x=False)
            parts += box("table.leg", (x, 0, z), (x + 0.05, height - 0.035, z + 0.05), leg)
    return parts


def chair(seat_color: tuple[int, int, int], seed: int) -> list[Patch]:
    """A wooden chair with a cushioned seat and slats; one sits facing +z."""
    grain = wood(OAK, seed, along_x=False)
    parts: list[Patch] = []
    for x in (-0.21, 0.17):
        parts += box("chair.leg", (x, 0, 0.16), (x + 0.04, 0.44, 0.2), grain)
        parts += box("chair.leg", (x, 0, -0.2), (x + 0.04, 0.92, -0.16), grain)
    parts += box("chair.frame", (-0.21, 0.4, -0.2), (0.21, 0.44, 0.2), wood(OAK, seed + 1))
    seat = pillow("chair.seat", (0.41, 0.06, 0.39), fabric(seat_color, seed + 2), 0.3)
    parts.append(seat.moved(Rotation.identity(), (0, 0.46, 0.0)))
    for y in (0.6, 0.73, 0.85):
        parts += box("chair.slat", (-0.17, y, -0.19), (0.17, y + 0.06, -0.17), wood(OAK, seed + int(y * 100)))
    return parts


def shelf(width: float, height: float, depth: float, boards: int, seed: int) -> list[Patch]:
    """A book shelf full of books and a few other things."""
    rng = np.random.default_rng(seed)
    grain = wood(WALNUT, seed)
    parts = box("shelf.left", (-width / 2, 0, 0), (-width / 2 + 0.02, height, depth), wood(WALNUT, seed, False))
    parts += box("shelf.right", (width / 2 - 0.02, 0, 0), (width / 2, height, depth), wood(WALNUT, seed, False))
    back = quad("shelf.back", (-width / 2, height, 0.01), (width, 0, 0), (0, -height, 0), wood((128, 92, 64), seed))
    parts.append(back)
    gap = (height - 0.1) / boards
    for level in range(boards + 1):
        y = 0.06 + level * gap
        low, high = (-width / 2 + 0.02, y, 0.0), (width / 2 - 0.02, y + 0.022, depth)
        parts += box("shelf.board", low, high, grain)
        if level < boards:
            parts += _books(width - 0.06, gap - 0.05, depth, (0.0, y + 0.022), seed + 31 * level, rng)
    return parts


def _books(
    width: float, room: float, depth: float, at: tuple[float, float], seed: int, rng: np.random.Generator
) -> list[Patch]:
    """Books in a row from the left, with a gap and sometimes a bowl in it."""
    parts: list[Patch] = []
    x, y = at[0] - width / 2, at[1]
    gap_at = float(rng.uniform(0.25, 0.7)) * width - width / 2
    number = 0
    while x < width / 2 - 0.05:
        if gap_at is not None and x > gap_at:
            parts += moved(vase(0.14, (SAGE, RUST, SAND, NAVY)[seed % 4], seed), (x + 0.11, y, depth * 0.6))
            x, gap_at = x + 0.23, 1e9
            continue
        thick, tall = float(rng.uniform(0.018, 0.05)), room * float(rng.uniform(0.62, 0.97))
        deep = depth * float(rng.uniform(0.62, 0.9))
        number += 1
        image = art.spine(max(12, int(thick * 900)), int(tall * 900), seed * 53 + number)
        cover = tuple(int(c) for c in image[2, 2])
        side, paper = plain((cover[0], cover[1], cover[2]), number), plain((226, 218, 198), number)
        face = picture(image, thick, tall)
        whole = box("book", (x, y, 0.02), (x + thick, y + tall, deep), side, top=paper, front=face, texel_m=0.002)
        parts += [p for p in whole if not p.name.endswith(("back", "bottom"))]
        x += thick + 0.0015
    return parts


def sideboard(width: float, seed: int) -> list[Patch]:
    """A low cupboard with three doors and knobs."""
    parts = box("sideboard", (-width / 2, 0.12, -0.22), (width / 2, 0.8, 0.22), wood(OAK, seed))
    parts += [
        patch
        for x in (-width / 2 + 0.06, width / 2 - 0.1)
        for z in (-0.18, 0.14)
        for patch in box("sideboard.leg", (x, 0, z), (x + 0.04, 0.12, z + 0.04), wood(WALNUT, seed))
    ]
    door = width / 3
    for k in range(3):
        x = -width / 2 + k * door
        panel = wood((208, 170, 124), seed + 7 * k, along_x=False)
        low, high = (x + 0.012, 0.135, 0.22), (x + door - 0.012, 0.785, 0.236)
        parts += box("sideboard.door", low, high, panel)
        knob_x = x + (door - 0.07 if k == 0 else 0.05)
        parts += box("sideboard.knob", (knob_x, 0.52, 0.236), (knob_x + 0.02, 0.54, 0.255), plain((40, 38, 36)))
    return parts


def vase(height: float, color: tuple[int, int, int], seed: int) -> list[Patch]:
    """A round vase or pot."""
    r = height * 0.36
    profile = [
        (r * 0.45, height * 0.75),
        (r * 0.55, height),
        (r * 0.62, height),
        (r * 0.6, height * 0.9),
        (r, height * 0.5),
        (r * 0.9, height * 0.22),
        (r * 0.5, 0),
    ]
    return [lathe("vase", profile, plain(color, seed, 0.12), 24, 0.003)]


def plant(height: float, leaves: int, seed: int, pot_scale: float = 1.0) -> list[Patch]:
    """A leafy plant in a pot."""
    rng = np.random.default_rng(seed)
    k = pot_scale
    rim = [(0.15, 0.3), (0.19, 0.34), (0.2, 0.34), (0.19, 0.3), (0.14, 0.0)]
    clay, soil = plain((196, 116, 82), seed, 0.14), plain((64, 48, 38))
    parts = [lathe("plant.pot", [(k * r, k * y) for r, y in rim], clay), disc("plant.soil", 0.17 * k, 0.31 * k, soil)]
    stem = plain((96, 86, 52), seed)
    parts += box("plant.stem", (-0.012 * k, 0.3 * k, -0.012 * k), (0.012 * k, height * 0.7, 0.012 * k), stem)
    for number in range(leaves):
        share = number / leaves
        length = float(rng.uniform(0.3, 0.46)) * (1.1 - 0.45 * share) * k**0.6
        width = length * float(rng.uniform(0.34, 0.46))
        one = leaf("plant.leaf", length, width, float(rng.uniform(0.35, 0.75)), leaf_green(seed + number, width))
        angles = (number * 137.5 + rng.uniform(-15, 15), -rng.uniform(0, 25) * share)
        turn = Rotation.from_euler("yx", angles, degrees=True)
        parts.append(one.moved(turn, (0, 0.36 * k + (height - 0.5 * k) * 0.75 * share, 0)))
    return parts


def floor_lamp(height: float, seed: int) -> list[Patch]:
    """A standing lamp with a cloth shade that glows."""
    metal = plain((58, 54, 50), seed)
    foot = [(0.001, 0.03), (0.14, 0.03), (0.15, 0.0)]
    parts = [lathe("lamp.foot", foot, metal), lathe("lamp.pole", [(0.012, height - 0.15), (0.012, 0.02)], metal, 10)]
    shade = [(0.13, height), (0.2, height - 0.28)]
    parts.append(lathe("lamp.shade", shade, fabric((252, 226, 178), seed), 28, emission=1.15))
    return parts


def pendant(y: float, ceiling: float) -> list[Patch]:
    """A paper lantern on a cord."""
    angle = np.linspace(0.02, np.pi - 0.02, 17)
    ball = [(0.2 * float(np.sin(a)), y + 0.18 * float(np.cos(a))) for a in angle]
    ribs = fabric((255, 244, 222), 5)
    cord = lathe("pendant.cord", [(0.006, ceiling), (0.006, y + 0.17)], plain((60, 58, 56)), 8)
    return [lathe("pendant.ball", ball, ribs, emission=1.25), cord]


def framed(width: float, height: float, style: str, seed: int) -> list[Patch]:
    """A framed picture whose back touches the plane z = 0, centred."""
    rim, mat = 0.022, 0.035
    edge = wood((WALNUT, OAK, (44, 42, 42))[seed % 3], seed)
    parts = box("frame", (-width / 2, -height / 2, 0), (width / 2, height / 2, 0.02), edge)
    inner_w, inner_h = width - 2 * rim, height - 2 * rim
    paper = quad(
        "frame.mat", (-inner_w / 2, inner_h / 2, 0.021), (inner_w, 0, 0), (0, -inner_h, 0), plain((240, 237, 230))
    )
    w, h = inner_w - 2 * mat, inner_h - 2 * mat
    painters = {"landscape": art.landscape, "blocks": art.blocks, "circles": art.circles, "contours": art.contours}
    image = painters[style](int(w * 700), int(h * 700), seed)
    print_ = quad("frame.art", (-w / 2, h / 2, 0.022), (w, 0, 0), (0, -h, 0), picture(image, w, h), 0.002)
    return [*parts, paper, print_]


def sheet(width: float, height: float, image_seed: int) -> list[Patch]:
    """A printed page that lies flat, centred, its top towards -z."""
    image = art.page(int(width * 1400), int(height * 1400), image_seed)
    paint = picture(image, width, height)
    return [quad("sheet", (-width / 2, 0.002, -height / 2), (width, 0, 0), (0, 0, height), paint, 0.002)]


def book_pile(count: int, seed: int) -> list[Patch]:
    """Books lying on each other."""
    rng, parts, y = np.random.default_rng(seed), [], 0.0
    for k in range(count):
        w, d, h = rng.uniform(0.17, 0.26), rng.uniform(0.13, 0.19), rng.uniform(0.02, 0.042)
        back = picture(np.rot90(art.spine(int(h * 900), int(w * 900), seed * 7 + k)).copy(), w, h)
        cover = picture(art.circles(220, 160, seed + k), w, d)
        one = box("pile", (-w / 2, 0, -d / 2), (w / 2, h, d / 2), plain((224, 216, 196), k), cover, back, 0.002)
        parts += moved(one, (0, y, 0), float(rng.uniform(-14, 14)))
        y += h + 0.001
    return parts


def laptop(seed: int) -> list[Patch]:
    """An open laptop, its screen towards +z."""
    dark, grey = plain((36, 38, 42)), plain((172, 174, 178))
    keys = art.blocks(340, 220, seed + 2) // 4
    parts = box(
        "laptop.base", (-0.17, 0, -0.11), (0.17, 0.015, 0.12), grey, top=picture(keys, 0.34, 0.23), texel_m=0.002
    )
    lid = box("laptop.lid", (-0.17, 0, -0.006), (0.17, 0.23, 0.0), grey, front=dark)
    screen = art.landscape(640, 420, seed)
    lid.append(
        quad(
            "laptop.screen", (-0.16, 0.22, 0.001), (0.32, 0, 0), (0, -0.21, 0), picture(screen, 0.32, 0.21), 0.002, 0.45
        )
    )
    tilt = Rotation.from_euler("x", -14, degrees=True)
    return parts + [patch.moved(tilt, (0, 0.015, -0.11)) for patch in lid]


def mug(color: tuple[int, int, int], seed: int) -> list[Patch]:
    """A mug without a handle."""
    cup = [(0.034, 0.02), (0.037, 0.095), (0.041, 0.095), (0.04, 0.01), (0.034, 0.0)]
    coffee = disc("mug.coffee", 0.036, 0.075, plain((58, 36, 24)), 0.002)
    return [lathe("mug", cup, plain(color, seed, 0.1), 22, 0.002), coffee]


def bowl(radius: float, seed: int) -> list[Patch]:
    """A bowl of oranges."""
    dish = [(radius * 0.4, 0.02), (radius * 0.95, 0.08), (radius, 0.08), (radius * 0.45, 0.0)]
    parts = [lathe("bowl", dish, plain(NAVY, seed, 0.15), 28, 0.003)]
    for k in range(5):
        a, fruit = (
            k * 2 * np.pi / 5,
            pillow("orange", (0.075, 0.072, 0.075), plain((226, 136, 44), seed + k, 0.14), 1.0, 0.003),
        )
        parts.append(fruit.moved(Rotation.identity(), (0.5 * radius * np.cos(a), 0.075, 0.5 * radius * np.sin(a))))
    return parts
