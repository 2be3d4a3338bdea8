"""A bare mesh: PLY, OBJ, STL or GLB. GLB is in metres with y up by its standard; the others do not say, so we ask.

Programs break GLB's standard, and write millimetres or z up. So what people say counts more than the standard, and
where nobody said anything, a room as large as a town is asked about too.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gazeloc_core.arrays import Bytes, Floats
from gazeloc_core.errors import InputError
from gazeloc_core.progress import Report
from gazeloc_core.readers.obj_file import mesh_of, pictures_of, read_obj
from gazeloc_core.scan import Mesh, RoomScan, Texture
from gazeloc_core.storage.user_files import about, read_bytes

ENDINGS = (".ply", ".obj", ".glb", ".stl")
METRES_PER_UNIT = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "in": 0.0254}
UP_AXES = ("x", "y", "z", "-x", "-y", "-z")
REMEDY = "export it again"
PLAUSIBLE_M = (0.05, 300.0)
"""The longest side of what people scan: from a cup to a factory hall."""


def recognise(path: Path) -> str | None:
    """Why this is a bare mesh, or None."""
    if path.is_file() and path.suffix.lower() in ENDINGS:
        return f"it is a {path.suffix[1:].upper()} file"
    if path.is_dir() and len(meshes := meshes_in(path)) == 1:
        return f"it holds one mesh, {meshes[0].name}"
    return None


def meshes_in(folder: Path) -> list[Path]:
    """The mesh files of a folder by name."""
    return sorted(p for p in folder.iterdir() if p.suffix.lower() in ENDINGS and not p.name.startswith("."))


def read(path: Path, unit: str | None, up_axis: str | None, report: Report) -> RoomScan:
    """The scan, its own axes kept and scaled to metres.

    Raises:
        InputError: if the file does not parse, or does not say its unit or up axis and neither do the arguments.
    """
    file = meshes_in(path)[0] if path.is_dir() else path
    report(0.1, f"reading {file.name}")
    notes: list[str] = []
    if file.suffix.lower() == ".obj":
        obj = read_obj(file)
        notes.extend(missing_pictures(list(pictures_of(obj).values())))
        mesh = mesh_of(obj)
    else:
        mesh = mesh_through_trimesh(file)
    if file.suffix.lower() == ".glb":
        notes.extend(_against_standard(unit, up_axis))
        unit, up_axis = unit or (None if _implausible(mesh, "m") else "m"), up_axis or "y"
    if unit is None or up_axis is None:
        raise InputError(_question(file, mesh, unit, up_axis))
    scale = METRES_PER_UNIT[unit]
    size = np.ptp(mesh.bounds, axis=0) * scale
    notes.append(f"The mesh is {_size_text(size)} m, read in {unit} with {up_axis} up.")
    if (odd := _implausible(mesh, unit)) is not None:
        notes.append(f"That is {odd} for a scan: if the unit is another one, make the project anew with --unit.")
    scaled = Mesh(mesh.vertices * scale, mesh.faces, mesh.colors, mesh.texture)
    kind = f"{file.suffix[1:].upper()} mesh"
    return RoomScan(path, kind, scaled, up_axis=up_axis, notes=tuple(notes), metres_per_unit=scale)


def check_unit_and_axis(unit: str | None, up_axis: str | None) -> None:
    """Refuse a unit or an up axis that is none.

    Raises:
        InputError: with the choices.
    """
    if unit is not None and unit not in METRES_PER_UNIT:
        raise InputError(f"The unit {unit!r} is unknown; use one of {', '.join(METRES_PER_UNIT)}.")
    if up_axis is not None and up_axis not in UP_AXES:
        raise InputError(f"The up axis {up_axis!r} is unknown; use one of {', '.join(UP_AXES)}.")


def missing_pictures(pictures: list[Path]) -> list[str]:
    """A sentence for each picture that a material names and that is not there."""
    return [f"The material names the picture {p.name}, which is not there." for p in pictures if not p.is_file()]


def _against_standard(unit: str | None, up_axis: str | None) -> list[str]:
    """A sentence where people say otherwise than GLB's standard."""
    if unit in (None, "m") and up_axis in (None, "y"):
        return []
    return [f"By its standard a GLB is in m with y up; this one is read in {unit or 'm'} with {up_axis or 'y'} up."]


def _implausible(mesh: Mesh, unit: str) -> str | None:
    """How odd the mesh's size would be in this unit: too large, too small, or None."""
    longest = float(np.ptp(mesh.bounds, axis=0).max()) * METRES_PER_UNIT[unit]
    if longest > PLAUSIBLE_M[1]:
        return "very large"
    return "very small" if longest < PLAUSIBLE_M[0] else None


def _question(file: Path, mesh: Mesh, unit: str | None, up_axis: str | None) -> str:
    size = np.ptp(mesh.bounds, axis=0)
    units = ", ".join(f"{_size_text(size * METRES_PER_UNIT[name])} m if in {name}" for name in ("m", "cm", "mm", "ft"))
    lacks = " and ".join(what for what, value in (("its unit", unit), ("which axis is up", up_axis)) if value is None)
    flags = " ".join(
        flag for flag, value in (("--unit m|cm|mm|ft|in", unit), ("--up x|y|z|-x|-y|-z", up_axis)) if value is None
    )
    return f"{file}: the file does not say {lacks} (x, y, z: the room would be {units}); pass {flags}."


def _size_text(size: Floats) -> str:
    return " x ".join(f"{value:.3g}" for value in size)


def mesh_through_trimesh(path: Path) -> Mesh:
    """The mesh of a PLY, STL or GLB as written; a GLB's nodes are placed by their transforms.

    Raises:
        InputError: if the file is missing, does not parse or holds no triangles.
    """
    import trimesh  # takes a second, and most scans are not read by it

    read_bytes(path)
    try:
        scene = trimesh.load_scene(path, process=False)
        parts = [
            (np.asarray(matrix), scene.geometry[name])
            for matrix, name in (scene.graph[node] for node in scene.graph.nodes_geometry)
        ]
        pieces = [_piece(matrix, part) for matrix, part in parts if isinstance(part, trimesh.Trimesh)]
    except Exception as error:  # trimesh raises whatever its parsers stumble over
        reason = str(error).splitlines()[0][:120] if str(error) else type(error).__name__
        raise InputError.of(path, f"the mesh cannot be read ({reason})", REMEDY) from error
    if not pieces:
        raise InputError.of(path, "the file holds no triangles", "it is a point cloud or cut off, export a mesh")
    with about(path):
        return _joined(pieces)


Piece = tuple[Floats, Any, Bytes | None, Any, Bytes | None]
"""Vertices, faces, colours per vertex, texture coordinates per corner and the picture, the last three maybe None."""


def _piece(matrix: Floats, part: Any) -> Piece:
    vertices = np.asarray(part.vertices) @ matrix[:3, :3].T + matrix[:3, 3]
    faces = np.asarray(part.faces)
    if np.linalg.det(matrix[:3, :3]) < 0:
        faces = faces[:, ::-1]
    visual = part.visual
    if visual.kind == "texture" and getattr(visual, "uv", None) is not None:
        material = visual.material
        picture = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
        if picture is not None:
            uv = np.asarray(visual.uv, dtype=np.float32)[faces]
            return vertices, faces, None, uv, np.asarray(picture.convert("RGB"), dtype=np.uint8)
    if visual.kind == "vertex":
        return vertices, faces, np.asarray(visual.vertex_colors[:, :3], dtype=np.uint8), None, None
    if visual.kind == "face":
        return (
            vertices[faces].reshape(-1, 3),
            np.arange(3 * len(faces)).reshape(-1, 3),
            np.repeat(np.asarray(visual.face_colors[:, :3], dtype=np.uint8), 3, axis=0),
            None,
            None,
        )
    return vertices, faces, None, None, None


def _joined(pieces: list[Piece]) -> Mesh:
    offsets = np.cumsum([0, *(len(piece[0]) for piece in pieces)])
    vertices = np.concatenate([piece[0] for piece in pieces])
    faces = np.concatenate([piece[1] + offset for piece, offset in zip(pieces, offsets, strict=False)])
    if any(piece[4] is not None for piece in pieces):
        images = tuple(piece[4] for piece in pieces if piece[4] is not None)
        counter = iter(range(len(images)))
        index = [np.full(len(p[1]), -1 if p[4] is None else next(counter), dtype=np.int32) for p in pieces]
        uvs = [np.zeros((len(p[1]), 3, 2), dtype=np.float32) if p[3] is None else p[3] for p in pieces]
        return Mesh(vertices, faces, None, Texture(images, np.concatenate(uvs), np.concatenate(index)))
    if any(piece[2] is not None for piece in pieces):
        colors = [np.full((len(p[0]), 3), 160, dtype=np.uint8) if p[2] is None else p[2] for p in pieces]
        return Mesh(vertices, faces, np.concatenate(colors))
    return Mesh(vertices, faces)
