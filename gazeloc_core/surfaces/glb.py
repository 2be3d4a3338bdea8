"""Binary glTF files for the viewer: meshes in their true colours, and lines.

The material is unlit (KHR_materials_unlit) and double-sided, and there are no normals, so that the picture shows the
scan's own colours and nothing else. glTF takes vertex colours as *linear* light but textures as sRGB: vertex colours
are converted here, to 16 bits, in which every 8-bit sRGB value survives the way there and back.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from gazeloc_core.arrays import Bytes, Floats
from gazeloc_core.errors import InputError
from gazeloc_core.scan import Mesh, Texture

Rgb = tuple[int, int, int]
WHITE: Rgb = (255, 255, 255)
NO_COLOR: Rgb = (160, 160, 160)
"""Of a mesh without colours; as in raycast.py."""
NO_PICTURE: Rgb = (128, 128, 128)
"""Of faces that no texture covers; as in raycast.py."""

_FLOAT, _USHORT, _UINT = 5126, 5123, 5125
_ARRAY_BUFFER, _INDEX_BUFFER = 34962, 34963
_LINES, _TRIANGLES = 1, 4
_FULL_COLOR = cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444
_JPEG = [cv2.IMWRITE_JPEG_QUALITY, 95, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, _FULL_COLOR]


def linear_from_srgb(srgb: ArrayLike) -> Floats:
    """Linear light in 0..1 of sRGB values 0..255, IEC 61966-2-1."""
    s = np.asarray(srgb, dtype=np.float64) / 255
    return np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4)


_LINEAR_U16 = np.rint(linear_from_srgb(np.arange(256)) * 65535).astype(np.uint16)


@dataclass(frozen=True)
class Glb:
    """A glTF scene of one mesh: its JSON and its binary chunk; `to_bytes` writes the file in any tint."""

    document: dict[str, Any]
    binary: bytes

    @classmethod
    def from_bytes(cls, data: bytes, name: str) -> Glb:
        """A .glb file that `to_bytes` wrote; `name` is for the sentence.

        Raises:
            InputError: if it is not one, or cut off.
        """
        try:
            magic, version, total, text_size, _ = struct.unpack_from("<4sIII4s", data)
            start = 20 + text_size
            binary_size, kind = struct.unpack_from("<I4s", data, start)
            document = json.loads(data[20:start])
        except (struct.error, ValueError) as error:
            raise InputError.of(Path(name), f"not a .glb file ({error})", "remove it, it is made again") from error
        binary = data[start + 8 : start + 8 + binary_size]
        if (magic, version, kind) != (b"glTF", 2, b"BIN\0") or total != len(data) or len(binary) != binary_size:
            raise InputError.of(Path(name), "the .glb file is damaged", "remove it, it is made again")
        return cls(document, binary)

    def to_bytes(self, tint: Rgb = WHITE, two_sided: bool = True) -> bytes:
        """The .glb file with all colours multiplied (in linear light) by `tint`.

        Faces that are not `two_sided` vanish when seen from behind, such as a room's near walls from outside.
        """
        factor = linear_from_srgb(tint)
        materials = []
        for material in self.document["materials"]:
            pbr = material["pbrMetallicRoughness"]
            color = [float(c * f) for c, f in zip(pbr["baseColorFactor"][:3], factor, strict=True)]
            tinted = {**pbr, "baseColorFactor": [*color, 1.0]}
            materials.append({**material, "doubleSided": two_sided, "pbrMetallicRoughness": tinted})
        text = json.dumps({**self.document, "materials": materials}, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        binary = self.binary + b"\0" * (-len(self.binary) % 4)
        total = 12 + 8 + len(text) + 8 + len(binary)
        return b"".join(
            [
                struct.pack("<4sII", b"glTF", 2, total),
                struct.pack("<I4s", len(text), b"JSON"),
                text,
                struct.pack("<I4s", len(binary), b"BIN\0"),
                binary,
            ]
        )


def mesh_glb(mesh: Mesh) -> Glb:
    """A mesh in the frame `scan`, with its texture or vertex colours, or one grey if it has neither."""
    writer = _Writer()
    if mesh.texture is not None:
        for image_index, image in enumerate([*mesh.texture.images, None]):
            face_image = mesh.texture.image_of_face
            here = face_image == image_index if image is not None else face_image < 0
            if here.any():
                writer.add_textured(mesh, mesh.texture, np.flatnonzero(here), image)
        return writer.finish()
    attributes = {"POSITION": writer.add_positions(mesh.vertices)}
    if mesh.colors is not None:
        attributes["COLOR_0"] = writer.add_colors(mesh.colors)
    material = writer.add_material(WHITE if mesh.colors is not None else NO_COLOR)
    indices = writer.add(mesh.faces.astype(np.uint32).ravel(), _UINT, "SCALAR", _INDEX_BUFFER)
    writer.add_primitive(attributes, material, _TRIANGLES, indices)
    return writer.finish()


def lines_glb(segments: ArrayLike, colors: ArrayLike) -> Glb:
    """Lines one pixel wide: `segments` (N, 2, 3), N > 0; sRGB `colors` (3,) for all, (N, 3), or (N, 2, 3) per end."""
    ends = np.asarray(segments, dtype=np.float64).reshape(-1, 2, 3)
    assert len(ends) > 0, "no line to draw"
    srgb = np.asarray(colors, dtype=np.uint8)
    srgb = srgb[:, None] if srgb.ndim == 2 else srgb
    writer = _Writer()
    attributes = {
        "POSITION": writer.add_positions(ends.reshape(-1, 3)),
        "COLOR_0": writer.add_colors(np.broadcast_to(srgb, ends.shape).reshape(-1, 3)),
    }
    writer.add_primitive(attributes, writer.add_material(WHITE), _LINES, None)
    return writer.finish()


def wires_glb(points: Floats, edges: NDArray[np.int64], colors: Bytes) -> Glb:
    """Lines one pixel wide between `points` (V, 3) with sRGB `colors` (V, 3): `edges` (E, 2) of their rows, E > 0.

    A third of the bytes of `lines_glb` where lines share their ends, as in pyramids and paths.
    """
    assert len(edges) > 0, "no line to draw"
    writer = _Writer()
    attributes = {"POSITION": writer.add_positions(points), "COLOR_0": writer.add_colors(colors)}
    indices = writer.add(edges.astype(np.uint32).ravel(), _UINT, "SCALAR", _INDEX_BUFFER)
    writer.add_primitive(attributes, writer.add_material(WHITE), _LINES, indices)
    return writer.finish()


class _Writer:
    """Collects the parts of one glTF mesh; every buffer view holds one accessor or one picture."""

    def __init__(self) -> None:
        self._chunks: list[bytes] = []
        self._size = 0
        self._parts: dict[str, list[dict[str, Any]]] = {
            name: [] for name in ("bufferViews", "accessors", "materials", "textures", "images")
        }
        self._primitives: list[dict[str, Any]] = []

    def add(self, array: NDArray[Any], component: int, kind: str, target: int, **extra: Any) -> int:
        """An accessor of its own buffer view; rows must be a multiple of four bytes long, or `array` flat."""
        view = self._add_view(np.ascontiguousarray(array).tobytes(), target=target)
        return self._add_part(
            "accessors", bufferView=view, componentType=component, count=len(array), type=kind, **extra
        )

    def add_positions(self, points: Floats) -> int:
        """Positions with the bounds that glTF demands."""
        p = points.astype(np.float32)
        bounds = {"min": p.min(axis=0).tolist(), "max": p.max(axis=0).tolist()}
        return self.add(p, _FLOAT, "VEC3", _ARRAY_BUFFER, **bounds)

    def add_colors(self, srgb: Bytes) -> int:
        """Opaque colours; four components because a row of three 16-bit ones would not be aligned."""
        rgba = np.full((len(srgb), 4), 65535, dtype=np.uint16)
        rgba[:, :3] = _LINEAR_U16[srgb]
        return self.add(rgba, _USHORT, "VEC4", _ARRAY_BUFFER, normalized=True)

    def add_material(self, color: Rgb, image: Bytes | None = None) -> int:
        """An unlit material of one colour or a picture."""
        pbr: dict[str, Any] = {
            "baseColorFactor": [*linear_from_srgb(color).tolist(), 1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": 1.0,
        }
        if image is not None:
            done, jpeg = cv2.imencode(".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), _JPEG)
            assert done
            source = self._add_part("images", bufferView=self._add_view(jpeg.tobytes()), mimeType="image/jpeg")
            pbr["baseColorTexture"] = {"index": self._add_part("textures", source=source)}
        return self._add_part(
            "materials", pbrMetallicRoughness=pbr, doubleSided=True, extensions={"KHR_materials_unlit": {}}
        )

    def add_textured(self, mesh: Mesh, texture: Texture, faces: NDArray[np.int64], image: Bytes | None) -> None:
        """The faces that one picture covers (or none): a vertex of its own for every corner with another uv."""
        if image is None:
            used, corner = np.unique(mesh.faces[faces].ravel(), return_inverse=True)
            attributes = {"POSITION": self.add_positions(mesh.vertices[used])}
            material = self.add_material(NO_PICTURE)
        else:
            uv = texture.uv_of_corner[faces].reshape(-1, 2).astype(np.float32)
            vertex = mesh.faces[faces].ravel()
            first, corner = _unique_corners(vertex, uv)
            attributes = {"POSITION": self.add_positions(mesh.vertices[vertex[first]])}
            down = np.column_stack([uv[first, 0], 1 - uv[first, 1]])
            attributes["TEXCOORD_0"] = self.add(down, _FLOAT, "VEC2", _ARRAY_BUFFER)
            material = self.add_material(WHITE, image)
        indices = self.add(corner.astype(np.uint32), _UINT, "SCALAR", _INDEX_BUFFER)
        self.add_primitive(attributes, material, _TRIANGLES, indices)

    def add_primitive(self, attributes: dict[str, int], material: int, mode: int, indices: int | None) -> None:
        """Triangles or lines of the attributes' accessors."""
        primitive: dict[str, Any] = {"attributes": attributes, "material": material, "mode": mode}
        self._primitives.append(primitive if indices is None else {**primitive, "indices": indices})

    def finish(self) -> Glb:
        """The scene of one node."""
        document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "GazeLoc"},
            "extensionsUsed": ["KHR_materials_unlit"],
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": self._primitives}],
            "buffers": [{"byteLength": self._size}],
            **{name: parts for name, parts in self._parts.items() if parts},
        }
        return Glb(document, b"".join(self._chunks))

    def _add_view(self, data: bytes, **extra: Any) -> int:
        padded = data + b"\0" * (-len(data) % 4)
        self._chunks.append(padded)
        offset, self._size = self._size, self._size + len(padded)
        return self._add_part("bufferViews", buffer=0, byteOffset=offset, byteLength=len(data), **extra)

    def _add_part(self, kind: str, **fields: Any) -> int:
        self._parts[kind].append(fields)
        return len(self._parts[kind]) - 1


def _unique_corners(vertex: NDArray[np.int32], uv: NDArray[np.float32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The first corner of each distinct (vertex, u, v), and for every corner the number of its own."""
    keys: Iterable[NDArray[Any]] = (uv[:, 1], uv[:, 0], vertex)
    order = np.lexsort(tuple(keys))
    rows_differ = (np.diff(vertex[order]) != 0) | (np.diff(uv[order], axis=0) != 0).any(axis=1)
    starts = np.concatenate([[True], rows_differ])
    number = np.empty(len(vertex), dtype=np.int64)
    number[order] = np.cumsum(starts) - 1
    return order[starts], number
