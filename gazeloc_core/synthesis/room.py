"""The made-up room: its shell, where the furniture stands, its lights and tags, and pictures of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.arrays import Bytes, Floats
from gazeloc_core.camera import Camera
from gazeloc_core.progress import Report, silent
from gazeloc_core.scan import Mesh
from gazeloc_core.synthesis import art
from gazeloc_core.synthesis import furniture as f
from gazeloc_core.synthesis.embree import ray_scene
from gazeloc_core.synthesis.geometry import Patch, box, moved, quad
from gazeloc_core.synthesis.lighting import AreaLight, Lamp, bake
from gazeloc_core.synthesis.renderer import Rays, Renderer, developed, painted, triangulated
from gazeloc_core.synthesis.tags import PlacedTag, place
from gazeloc_core.synthesis.textures import fabric, picture, plain, plank_floor, rug, wall

X, Y, Z = 2.75, 2.6, 2.1
"""Half the width, the height and half the depth of the room."""
SCAN_FROM_ROOM = RigidTransform.from_components((0.35, -1.42, -0.8), Rotation.from_euler("y", 23, degrees=True))
"""ARKit starts its world where the phone is switched on, level with gravity, turned as it happens to be held."""
WINDOW = (0.35, 2.15, 0.95, 2.2)
"""Its left, right, lower and upper edge on the wall z = -Z."""


@dataclass(frozen=True, eq=False)
class Room:
    """A room in scan coordinates: exact `mesh`, exact `tags`, and what draws it."""

    mesh: Mesh
    tags: tuple[PlacedTag, ...]
    renderer: Renderer
    patches: tuple[Patch, ...]
    patch_of_face: NDArray[np.int64]
    """(F,) which patch each face of the mesh belongs to."""
    phone_exposure: float = 1.45
    scan_from_room: RigidTransform = SCAN_FROM_ROOM


def build_room(
    tag_ids: Sequence[int] = tuple(range(8)),
    tag_size_m: float = 0.16,
    bare: bool = False,
    light_spacing_m: float = 0.05,
    light_rays: int = 48,
    texel_scale: float = 1.0,
    seed: int = 1,
    report: Report = silent,
) -> Room:
    """A furnished (or bare) room with the tags that are asked for, lit and painted.

    `texel_scale` above 1 makes all textures but the tags coarser, and the room faster to make.
    """
    patches = _shell(seed, bare) + ([] if bare else _furniture(seed)) + _essentials(seed)
    patches = [replace(patch, texel_m=patch.texel_m * texel_scale) for patch in patches]
    tags = []
    for tag_id, center, rotation in TAG_PLACES:
        if tag_id in tag_ids:
            paper, tag = place(tag_id, center, rotation, tag_size_m)
            patches.append(paper)
            tags.append(PlacedTag(tag_id, SCAN_FROM_ROOM.apply(np.array(tag.corners))))
    rotation, offset = SCAN_FROM_ROOM.rotation, SCAN_FROM_ROOM.translation
    triangles = triangulated(patches)
    room_scene = ray_scene(triangles.vertices, triangles.faces)
    light = bake(
        patches,
        room_scene,
        triangles.patch_of_face,
        triangles.uv_of_corner,
        _lights(),
        light_spacing_m,
        light_rays,
        seed,
        report,
    )
    in_scan = [patch.moved(rotation, offset) for patch in patches]
    triangles = triangulated(in_scan)
    renderer = Renderer(ray_scene(triangles.vertices, triangles.faces), painted(in_scan, triangles, light))
    mesh = Mesh(triangles.vertices, triangles.faces.astype(np.int32))
    return Room(mesh, tuple(tags), renderer, tuple(in_scan), triangles.patch_of_face)


def render(
    room: Room, camera: Camera, scan_from_camera: RigidTransform, exposure: float = 1.0, samples: int = 4
) -> tuple[Bytes, Floats]:
    """A sharp picture (h, w, 3) sRGB and its depth (h, w) along z in metres, inf where nothing is."""
    radiance = np.zeros((camera.height, camera.width, 3))
    for offset in subpixels(samples):
        radiance += (
            room.renderer.shoot(Rays(camera, offset), scan_from_camera, footprint=samples**-0.5).radiance / samples
        )
    depth = room.renderer.shoot(Rays(camera), scan_from_camera, colors=False).depth
    return developed(radiance, exposure), np.asarray(depth, dtype=np.float64)


def subpixels(count: int) -> list[tuple[float, float]]:
    """Offsets within a pixel, evenly spread, their mean at its centre (Kronecker sequence of the plastic number)."""
    k = np.arange(count)[:, None]
    points = np.mod(0.5 + k * np.array([0.7548776662, 0.5698402910]), 1) - 0.5
    points -= points.mean(axis=0)
    return [(float(x), float(y)) for x, y in points]


def _facing(yaw_deg: float, pitch_deg: float = 0.0, roll_deg: float = 0.0) -> Rotation:
    return Rotation.from_euler("YXZ", (yaw_deg, pitch_deg, roll_deg), degrees=True)


TAG_PLACES: tuple[tuple[int, tuple[float, float, float], Rotation], ...] = (
    (0, (-1.1, 1.46, -Z), _facing(0)),
    (1, (X, 1.42, -1.2), _facing(-90)),
    (2, (0.62, 1.5, Z), _facing(180)),
    (3, (-X, 1.3, 1.3), _facing(90)),
    (4, (-0.86, 0.42, 0.3), _facing(90, -90)),
    (5, (-1.1, 0.46, 1.641), _facing(180)),
    (6, (0.86, 0.74, -1.62), _facing(0, -90)),
    (7, (1.26, 0.23, 0.85), _facing(-112)),
    (10, (-1.04, 1.02, -Z), _facing(0)),
    (11, (X, 0.92, 1.42), _facing(-90)),
    (12, (0.12, 1.24, Z), _facing(180)),
    (13, (-X, 1.04, 0.34), _facing(90)),
    (14, (-0.86, 0.8, 1.85), _facing(180, -90)),
    (15, (-0.62, 0.46, 1.641), _facing(180)),
    (16, (1.75, 0.0, -0.5), _facing(-90, -90)),
    (17, (1.43, 0.44, 0.92), _facing(-112, -90)),
)
"""Tag, centre and facing: ids below 10 are one setting of markers, the others a second one in other places."""


def _lights() -> list[AreaLight | Lamp]:
    left, right, low, high = WINDOW
    day = AreaLight((left, high, -Z + 0.02), (right - left, 0, 0), (0, low - high, 0), (4.6, 5.2, 6.0))
    warm = (1.0, 0.80, 0.56)
    ceiling = Lamp((-0.3, 2.12, 0.0), 0.16, tuple(2.1 * c for c in warm), 0.3)  # type: ignore[arg-type]
    corner = Lamp((-2.36, 1.42, 1.66), 0.1, tuple(0.8 * c for c in warm), 0.25)  # type: ignore[arg-type]
    return [day, ceiling, corner]


def _shell(seed: int, bare: bool) -> list[Patch]:
    """Floor, walls with a hole for nothing (the window hangs before them), ceiling, skirting boards, door, window."""
    cream, accent = wall((226, 219, 204), seed), wall((156, 172, 160), seed + 9)
    parts = [
        quad("floor", (-X, 0, -Z), (2 * X, 0, 0), (0, 0, 2 * Z), plank_floor(seed + 1)),
        quad("ceiling", (-X, Y, Z), (2 * X, 0, 0), (0, 0, -2 * Z), wall((238, 236, 230), seed + 2), 0.008),
        quad("wall.north", (-X, Y, -Z), (2 * X, 0, 0), (0, -Y, 0), cream),
        quad("wall.south", (X, Y, Z), (-2 * X, 0, 0), (0, -Y, 0), wall((226, 219, 204), seed + 3)),
        quad("wall.west", (-X, Y, Z), (0, 0, -2 * Z), (0, -Y, 0), accent),
        quad("wall.east", (X, Y, -Z), (0, 0, 2 * Z), (0, -Y, 0), wall((226, 219, 204), seed + 4)),
    ]
    board = plain((236, 233, 226), seed)
    parts += box("skirting", (-X, 0, -Z), (X, 0.09, -Z + 0.015), board)
    parts += box("skirting", (-X, 0, Z - 0.015), (1.13, 0.09, Z), board)
    parts += box("skirting", (-X, 0, -Z), (-X + 0.015, 0.09, Z), board)
    parts += box("skirting", (X - 0.015, 0, -Z), (X, 0.09, Z), board)
    return parts + _window(seed) + _door(seed) + ([] if bare else _curtains(seed))


def _window(seed: int) -> list[Patch]:
    left, right, low, high = WINDOW
    view = picture(art.garden(900, 620, seed), right - left, high - low)
    parts = [quad("window", (left, high, -Z + 0.005), (right - left, 0, 0), (0, low - high, 0), view, emission=1.5)]
    white = plain((242, 240, 236), seed)
    middle = (left + right) / 2
    for x0, x1, y0, y1 in (
        (left - 0.06, right + 0.06, high, high + 0.06),
        (left - 0.06, left, low, high),
        (right, right + 0.06, low, high),
        (middle - 0.025, middle + 0.025, low, high),
        (left, right, low + 0.86, low + 0.9),
    ):
        parts += box("window.frame", (x0, y0, -Z), (x1, y1, -Z + 0.035), white)
    return parts + box("window.sill", (left - 0.1, low - 0.04, -Z), (right + 0.1, low, -Z + 0.14), white)


def _curtains(seed: int) -> list[Patch]:
    left, right, _, high = WINDOW
    parts = []
    for x in (left - 0.42, right + 0.02):
        u, v = np.linspace(0, 1, 57), np.array([0.0, 1.0])
        grid = np.empty((2, 57, 3))
        grid[..., 0] = x + 0.4 * u
        grid[..., 1] = np.where(v == 0, high + 0.14, 0.04)[:, None]
        grid[..., 2] = -Z + 0.085 + 0.032 * np.sin(u * 2 * np.pi * 6) * np.where(v == 0, 0.8, 1.0)[:, None]
        cloth = fabric((206, 178, 142), seed + 1)
        parts.append(Patch("curtain", grid, (0.62, high + 0.1), cloth))
    rod = plain((70, 60, 52), seed)
    return parts + box(
        "curtain.rod", (left - 0.5, high + 0.14, -Z + 0.07), (right + 0.5, high + 0.165, -Z + 0.095), rod
    )


def _door(seed: int) -> list[Patch]:
    white = plain((234, 230, 220), seed, 0.04)
    parts = box("door", (-0.45, 0, 0), (0.45, 2.04, 0.03), white)
    for low, high in ((0.16, 0.86), (1.0, 1.88)):
        for x in (-0.36, 0.05):
            parts += box("door.panel", (x, low, 0.03), (x + 0.31, high, 0.042), plain((222, 217, 205), seed + 1, 0.04))
    parts += box("door.handle", (0.33, 1.02, 0.03), (0.42, 1.045, 0.085), plain((120, 112, 96)))
    for x0, x1, y0, y1 in ((-0.53, -0.45, 0, 2.12), (0.45, 0.53, 0, 2.12), (-0.45, 0.45, 2.04, 2.12)):
        parts += box("door.frame", (x0, y0, 0), (x1, y1, 0.05), plain((240, 237, 230), seed))
    return moved(parts, (1.68, 0, Z), 180)


def _essentials(seed: int) -> list[Patch]:
    """What carries a tag, so that a bare room has it too: coffee table, sideboard, shelf, box."""
    parts = moved(f.table(1.05, 0.6, 0.42, f.WALNUT, seed), (-0.86, 0, 0.0), 90)
    parts += moved(f.sideboard(1.6, seed + 1), (-1.1, 0, Z - 0.22), 180)
    parts += moved(f.shelf(1.3, 2.0, 0.32, 5, seed + 2), (X, 0, 0.2), -90)
    card = plain((190, 150, 104), seed, 0.1)
    return parts + moved(box("carton", (-0.2, 0, -0.18), (0.2, 0.44, 0.18), card), (1.43, 0, 0.92), -112)


def _furniture(seed: int) -> list[Patch]:
    parts = moved(f.sofa(2.1, seed), (-2.28, 0, -0.05), 90)
    parts.append(quad("rug", (-1.75, 0.012, -0.95), (2.3, 0, 0), (0, 0, 1.75), rug(2.3, 1.75, seed), 0.003))
    parts += moved(f.table(1.5, 0.68, 0.74, f.OAK, seed + 1), (1.25, 0, -1.66))
    parts += moved(f.chair(f.RUST, seed), (1.15, 0, -1.02), 168)
    parts += moved(f.chair(f.SAGE, seed + 5), (0.45, 0, 1.62), -160)
    parts += moved(f.plant(1.5, 22, seed), (-2.32, 0, -1.66))
    parts += moved(f.floor_lamp(1.56, seed), (-2.36, 0, 1.66))
    return parts + moved(f.pendant(2.12, Y), (-0.3, 0, 0)) + _small_things(seed) + _pictures(seed)


def _small_things(seed: int) -> list[Patch]:
    parts = moved(f.laptop(seed), (1.2, 0.74, -1.62), 8)
    parts += moved(f.mug(f.OCHRE, seed), (1.48, 0.74, -1.72))
    parts += moved(f.sheet(0.21, 0.297, seed), (1.74, 0.74, -1.52), 12)
    parts += moved(f.sheet(0.21, 0.297, seed + 1), (1.66, 0.742, -1.56), -9)
    parts += moved(f.book_pile(3, seed), (1.8, 0.74, -1.78), 30)
    parts += moved(f.vase(0.24, f.SAGE, seed), (0.6, 0.74, -1.84))
    parts += moved(f.book_pile(2, seed + 9), (-0.95, 0.42, -0.32), 76)
    parts += moved(f.bowl(0.13, seed), (-0.78, 0.42, -0.02))
    parts += moved(f.mug(f.RUST, seed + 1), (-1.02, 0.42, 0.1))
    parts += moved(f.vase(0.32, f.NAVY, seed + 1), (-1.7, 0.8, 1.86))
    parts += moved(f.plant(0.45, 11, seed + 3, 0.5), (-0.5, 0.8, 1.88))
    parts += moved(f.book_pile(4, seed + 5), (-1.2, 0.8, 1.84), 184)
    return parts


def _pictures(seed: int) -> list[Patch]:
    parts: list[Patch] = []
    places = (
        (0.62, 0.46, "landscape", (-X, 1.56, -0.72), 90),
        (0.46, 0.62, "circles", (-X, 1.58, 0.0), 90),
        (0.5, 0.4, "contours", (-X, 1.52, 0.68), 90),
        (0.7, 0.9, "blocks", (-1.3, 1.55, Z), 180),
        (0.42, 0.42, "circles", (-0.45, 1.62, Z), 180),
        (0.6, 0.8, "contours", (-1.75, 1.55, -Z), 0),
        (0.42, 0.56, "landscape", (-0.42, 1.55, -Z), 0),
        (0.5, 0.66, "blocks", (X, 1.5, 1.4), -90),
        (0.36, 0.3, "circles", (X, 1.6, -1.65), -90),
    )
    for number, (width, height, style, at, yaw) in enumerate(places):
        parts += moved(f.framed(width, height, style, seed + number), at, yaw)
    return parts
