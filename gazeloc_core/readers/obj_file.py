"""Wavefront OBJ files with their materials, parsed here so that corners keep their own texture coordinates.

Generic loaders split vertices along texture seams and fall silent where an MTL or a picture is missing.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from gazeloc_core.arrays import Bytes, Floats, Ints
from gazeloc_core.errors import InputError
from gazeloc_core.scan import Mesh, Texture
from gazeloc_core.storage.user_files import about, read_bytes, read_text

REMEDY = "the file is cut off or damaged, export it again"


@dataclass(frozen=True, eq=False)
class ObjFile:
    """What an OBJ says: vertices (V, 3) in the file's unit, triangles, and texture coordinates (T, 2) by corner.

    `corners` is (F, 3, 2): index of vertex and of texture coordinate, -1 for none. `material_of_face` (F,) indexes
    `materials`, -1 for none. `colors` (V, 3) where vertex lines carry them. `libraries` are the names of MTL files.
    """

    path: Path
    vertices: Floats
    colors: Bytes | None
    uvs: Floats
    corners: Ints
    material_of_face: Ints
    materials: tuple[str, ...]
    libraries: tuple[str, ...]


def read_obj(path: Path) -> ObjFile:
    """The content of an OBJ file; polygons become fans of triangles.

    Raises:
        InputError: with the line, where one does not parse.
    """
    rows: dict[bytes, list[bytes]] = {b"v": [], b"vt": [], b"f": []}
    materials: list[str] = []
    libraries: list[str] = []
    starts: list[tuple[int, int]] = []  # face row from which a material holds
    for line in read_bytes(path).splitlines():
        key, _, rest = line.strip().partition(b" ")
        if key in rows:
            rows[key].append(rest)
        elif key == b"usemtl":
            name = rest.strip().decode("utf-8", "replace")
            if name not in materials:
                materials.append(name)
            starts.append((len(rows[b"f"]), materials.index(name)))
        elif key == b"mtllib":
            libraries.append(rest.strip().decode("utf-8", "replace"))
    table = _table(path, b"v", rows[b"v"], (3, 4, 6, 7))
    uvs = _table(path, b"vt", rows[b"vt"], (2, 3))[:, :2]
    corners, row_of_face = _faces(path, rows[b"f"], len(table), len(uvs))
    material_of_row = np.full(len(rows[b"f"]), -1, dtype=np.int64)
    for start, material in starts:
        material_of_row[start:] = material
    return ObjFile(
        path,
        table[:, :3],
        _colors(table),
        uvs,
        corners,
        material_of_row[row_of_face],
        tuple(materials),
        tuple(libraries),
    )


def _table(path: Path, key: bytes, rows: list[bytes], widths: tuple[int, ...]) -> Floats:
    """The numbers of all lines of one kind, (rows, width)."""
    if not rows:
        return np.zeros((0, widths[0]))
    width = len(rows[0].split())
    for row in rows:
        if len(row.split()) != width or width not in widths:
            raise _bad_line(path, key, row)
    try:
        return np.array(b" ".join(rows).split()).astype(np.float64).reshape(-1, width)
    except ValueError:
        raise next(_bad_line(path, key, row) for row in rows if not _parses(row)) from None


def _parses(row: bytes) -> bool:
    try:
        [float(word) for word in row.split()]
    except ValueError:
        return False
    return True


def _bad_line(path: Path, key: bytes, row: bytes) -> InputError:
    text = f"{key.decode()} {row.decode('utf-8', 'replace')}"[:60]
    return InputError.of(path, f"the line {text!r} is not complete", REMEDY)


def _colors(table: Floats) -> Bytes | None:
    """Colours that follow the coordinates, written from 0 to 1 or from 0 to 255."""
    if table.shape[1] < 6:
        return None
    colors = table[:, -3:]
    scale = 255.0 if colors.max(initial=0.0) <= 1.0 else 1.0
    return np.clip(np.rint(colors * scale), 0, 255).astype(np.uint8)


def _faces(path: Path, rows: list[bytes], vertex_count: int, uv_count: int) -> tuple[Ints, Ints]:
    """Triangles' corners (F, 3, 2) from 0, and the row each came from."""
    if (fast := _plain_triangles(rows, vertex_count, uv_count)) is not None:
        return fast, np.arange(len(rows))
    corners: list[tuple[tuple[int, int], ...]] = []
    row_of_face: list[int] = []
    for number, row in enumerate(rows):
        words = row.split()
        if len(words) < 3:
            raise _bad_line(path, b"f", row)
        try:
            polygon = [_corner(word, vertex_count, uv_count) for word in words]
        except ValueError:
            raise _bad_line(path, b"f", row) from None
        except IndexError:
            text = f"f {row.decode('utf-8', 'replace')}"[:60]
            problem = (
                f"the line {text!r} names what is not among the {vertex_count} vertices and {uv_count} coordinates"
            )
            raise InputError.of(path, problem, REMEDY) from None
        for i in range(1, len(polygon) - 1):
            corners.append((polygon[0], polygon[i], polygon[i + 1]))
            row_of_face.append(number)
    return np.array(corners, dtype=np.int64).reshape(-1, 3, 2), np.array(row_of_face, dtype=np.int64)


def _plain_triangles(rows: list[bytes], vertex_count: int, uv_count: int) -> Ints | None:
    """The corners where all rows are triangles of one pattern (`v`, `v/vt`, `v//vn` or `v/vt/vn`), else None."""
    text = b" ".join(rows)
    per_corner, rest = divmod(text.count(b"/"), 3 * max(len(rows), 1))
    double = text.count(b"//")
    if rest or double not in (0, 3 * len(rows)) or any(len(row.split()) != 3 for row in rows):
        return None
    words = text.replace(b"//" if double else b"/", b" ").split()
    width = per_corner if double else per_corner + 1
    if not words or len(words) != 3 * len(rows) * width:
        return None
    try:
        numbers = np.array(words).astype(np.int64).reshape(-1, 3, width)
    except ValueError:
        return None
    vertex = numbers[..., 0]
    uv = numbers[..., 1] if width > 1 and not double else np.zeros_like(vertex)
    if vertex.min() < 1 or vertex.max() > vertex_count or uv.min() < 0 or uv.max() > uv_count:
        return None
    return np.stack([vertex - 1, uv - 1], axis=-1)


def _corner(word: bytes, vertex_count: int, uv_count: int) -> tuple[int, int]:
    """`v`, `v/vt`, `v//vn` or `v/vt/vn`; counted from 1, or backwards from the end where negative."""
    parts = word.split(b"/")
    vertex = int(parts[0])
    uv = int(parts[1]) if len(parts) > 1 and parts[1] else 0
    if vertex == 0 or abs(vertex) > vertex_count or abs(uv) > uv_count:
        raise IndexError
    return vertex - 1 if vertex > 0 else vertex + vertex_count, uv - 1 if uv >= 0 else uv + uv_count


def pictures_of(obj: ObjFile) -> dict[str, Path]:
    """The picture that each material of the file names, by material; the pictures need not exist."""
    pictures: dict[str, Path] = {}
    for library in obj.libraries:
        path = obj.path.parent / library
        if path.is_file():
            pictures.update(read_mtl(path))
    return {name: picture for name, picture in pictures.items() if name in obj.materials}


def read_mtl(path: Path) -> dict[str, Path]:
    """The pictures (`map_Kd`) of an MTL file's materials, whether or not they exist."""
    pictures: dict[str, Path] = {}
    material = ""
    for line in read_text(path).splitlines():
        key, _, rest = line.strip().partition(" ")
        if key == "newmtl":
            material = rest.strip()
        elif key == "map_Kd" and rest.strip():
            pictures[material] = path.parent / rest.strip().replace("\\", "/")
    return pictures


def mesh_of(obj: ObjFile, metres_per_unit: float = 1.0) -> Mesh:
    """The mesh, textured with those of its pictures that are there.

    Raises:
        InputError: if it is empty, or a picture does not decode.
    """
    there = {name: picture for name, picture in pictures_of(obj).items() if picture.is_file()}
    texture = _texture(obj, there) if there and (obj.corners[:, :, 1] >= 0).any() else None
    with about(obj.path):
        return Mesh(obj.vertices * metres_per_unit, obj.corners[:, :, 0].astype(np.int32), obj.colors, texture)


def _texture(obj: ObjFile, pictures: dict[str, Path]) -> Texture:
    images = tuple(read_picture(picture) for picture in pictures.values())
    index_of_material = np.array([*(list(pictures).index(m) if m in pictures else -1 for m in obj.materials), -1])
    has_uv = (obj.corners[:, :, 1] >= 0).all(axis=1)
    image_of_face: NDArray[np.int32] = np.where(has_uv, index_of_material[obj.material_of_face], -1).astype(np.int32)
    return Texture(images, obj.uvs[obj.corners[:, :, 1]].astype(np.float32), image_of_face)


def read_picture(path: Path) -> Bytes:
    """A picture as (H, W, 3) RGB.

    Raises:
        InputError: if it does not decode.
    """
    image = (
        cv2.imdecode(np.frombuffer(read_bytes(path), dtype=np.uint8), cv2.IMREAD_COLOR) if path.stat().st_size else None
    )
    if image is None:
        raise InputError.of(path, "the texture does not decode", "export the scan again")
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), dtype=np.uint8)
