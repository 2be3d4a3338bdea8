"""Pictures of the scan as a camera sees it, offscreen, in the scan's own colours.

Two renderers agree on every pixel but the edges: `PyrenderRenderer` (OpenGL through EGL, pinhole cameras, smooth
edges) and `RayRenderer` (a ray per pixel with Embree: any camera, with depth, needs no EGL). `open_renderer` takes the
first and says so by name where it has to take the second.

The axes of OpenGL's camera (x right, y up, z backwards) exist only in this file.
"""

from __future__ import annotations

import importlib
import os
import sys
import threading
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Bytes, Floats
from gazeloc_core.camera import Camera
from gazeloc_core.errors import RenderError
from gazeloc_core.scan import Mesh
from gazeloc_core.surfaces.display_mesh import shaded
from gazeloc_core.surfaces.glb import NO_PICTURE, WHITE, Rgb
from gazeloc_core.surfaces.raycast import Raycaster

BACKGROUND: Rgb = (32, 32, 36)
"""Where there is no scan."""
_GL_FROM_CAMERA = np.diag([1.0, -1.0, -1.0, 1.0])
_NEAR_M = 0.02


@dataclass(frozen=True, eq=False)
class Rendered:
    """A picture: `rgb` (H, W, 3) uint8, `depth_m` (H, W) along the camera's z axis, NaN for a miss, and who made it.

    `depth_m` is None from pyrender, whose smoothed edges also smooth its depth (11 mm at the 99th percentile).
    """

    rgb: Bytes
    depth_m: Floats | None
    by: str


class Renderer(Protocol):
    """Draws one mesh. `by` names it for people; `note` is the sentence to show where it is the alternative, else ""."""

    by: str
    note: str

    def render(self, camera: Camera, scan_from_camera: RigidTransform) -> Rendered:
        """The scan as the camera at this pose sees it."""
        ...

    def close(self) -> None:
        """Free what the renderer holds; it cannot draw afterwards."""
        ...


class PyrenderRenderer:
    """OpenGL through EGL: flat colours, both sides of each face, smooth edges. For pinhole cameras.

    One per process, used and closed in the thread that made it: EGL's context belongs to that thread, and closing it
    ends EGL for the process's other contexts.

    Raises:
        RenderError: if this machine has no working EGL.
    """

    by = "pyrender (OpenGL)"
    note = ""

    def __init__(self, mesh: Mesh):
        self._pyrender = _import_pyrender()
        self._thread = threading.get_ident()
        self._scene = self._pyrender.Scene(
            bg_color=[*(c / 255 for c in BACKGROUND), 1.0], ambient_light=[1.0, 1.0, 1.0]
        )
        self._scene.add(self._pyrender.Mesh(_primitives(self._pyrender, shaded(mesh))))
        self._bounds = mesh.bounds
        try:
            self._renderer = self._pyrender.OffscreenRenderer(64, 64)
        except Exception as error:  # PyOpenGL raises anything from ImportError to its own GLError
            raise RenderError(f"EGL does not start on this machine ({_first_line(error)}).") from error

    def render(self, camera: Camera, scan_from_camera: RigidTransform) -> Rendered:
        """The scan as the pinhole camera at this pose sees it.

        Raises:
            RenderError: if the camera has distortion, or OpenGL fails.
        """
        assert threading.get_ident() == self._thread, "an EGL context belongs to the thread that made it"
        if not camera.is_pinhole:
            raise RenderError(f"OpenGL draws pinhole cameras, not {camera.model}; render it with rays.")
        (fx, fy), (cx, cy) = camera.focal_px, camera.principal_point_px
        # OpenGL counts from the picture's corner, as we do: the first pixel centre is at 0.5.
        distance = np.linalg.norm(self._bounds - scan_from_camera.translation, axis=1).max()
        lens = self._pyrender.IntrinsicsCamera(fx, fy, cx, cy, znear=_NEAR_M, zfar=max(50.0, 2 * float(distance)))
        node = self._scene.add(lens, pose=scan_from_camera.as_matrix() @ _GL_FROM_CAMERA)
        flags = self._pyrender.RenderFlags.FLAT | self._pyrender.RenderFlags.SKIP_CULL_FACES
        try:
            self._renderer.viewport_width, self._renderer.viewport_height = camera.width, camera.height
            rgb, _ = self._renderer.render(self._scene, flags=flags)
        except Exception as error:
            raise RenderError(
                f"OpenGL failed to draw {camera.width}x{camera.height} ({_first_line(error)})."
            ) from error
        finally:
            self._scene.remove_node(node)
        return Rendered(np.array(rgb), None, self.by)

    def close(self) -> None:
        """Delete the context."""
        self._renderer.delete()


class RayRenderer:
    """A ray per pixel, cast with Embree: any camera model, colours and depth; edges are not smoothed."""

    by = "rays (Embree)"

    def __init__(self, mesh: Mesh, note: str = "", raycaster: Raycaster | None = None):
        self.note = note
        self._raycaster = raycaster or Raycaster(shaded(mesh))
        self._rays: dict[tuple[Any, ...], Floats] = {}

    def render(self, camera: Camera, scan_from_camera: RigidTransform) -> Rendered:
        """The scan as the camera at this pose sees it, with depth; background where the lens model has no ray."""
        rays_in_camera = self._rays_of(camera)
        directions = rays_in_camera @ scan_from_camera.rotation.as_matrix().T
        hits = self._raycaster.cast(scan_from_camera.translation, directions)
        shape = (camera.height, camera.width)
        depth = np.where(hits.is_hit, hits.distance * rays_in_camera[:, 2], np.nan).reshape(shape)
        return Rendered(self._raycaster.colors(hits, BACKGROUND).reshape(*shape, 3), depth, self.by)

    def close(self) -> None:
        """Nothing is held that needs freeing."""

    def _rays_of(self, camera: Camera) -> Floats:
        """The unit rays (H * W, 3) of one camera; the last two cameras' are kept, they cost 0.1 s and more."""
        key = (camera.model, camera.width, camera.height, *camera.params)
        if key not in self._rays:
            while len(self._rays) >= 2:
                self._rays.pop(next(iter(self._rays)))
            self._rays[key] = camera.unproject(camera.pixel_centres())
        return self._rays[key]


def open_renderer(mesh: Mesh, raycaster: Raycaster | None = None) -> Renderer:
    """Pyrender, or without EGL the renderer by rays, whose `note` then says so. Call it in the thread that draws.

    `raycaster` is used by the rays where the caller already has one of the same (shaded) mesh.
    """
    try:
        return PyrenderRenderer(mesh)
    except RenderError as error:
        return RayRenderer(mesh, f"Pictures of the scan are drawn with rays, without smooth edges: {error}", raycaster)


def _import_pyrender() -> Any:
    """Pyrender, told to use EGL before PyOpenGL is first imported, since it looks only then."""
    if not sys.platform.startswith("linux"):
        raise RenderError(f"Offscreen OpenGL needs EGL, which {sys.platform} does not have.")
    os.environ["PYOPENGL_PLATFORM"] = "egl"
    if not hasattr(np, "infty"):
        setattr(np, "infty", np.inf)  # noqa: B010  NumPy 2 dropped the name; pyrender 0.1.45 still uses it
    try:
        return importlib.import_module("pyrender")
    except Exception as error:  # a missing libEGL surfaces as ImportError, AttributeError or OSError
        raise RenderError(f"OpenGL does not load on this machine ({_first_line(error)}); install libegl1.") from error


def _first_line(error: Exception) -> str:
    return next(iter(str(error).splitlines()), type(error).__name__).strip() or type(error).__name__


def _primitives(pyrender: Any, mesh: Mesh) -> list[Any]:
    """The mesh as pyrender takes it: by vertex, or with a texture a part per picture with every corner on its own."""
    if mesh.texture is None:
        colors = np.asarray(mesh.colors, dtype=np.float32) / 255
        return [
            pyrender.Primitive(
                positions=mesh.vertices.astype(np.float32),
                indices=mesh.faces.astype(np.uint32),
                color_0=np.column_stack([colors, np.ones(len(colors), np.float32)]),
                material=_flat_material(pyrender, WHITE, None),
            )
        ]
    texture, parts = mesh.texture, []
    for image_index in np.unique(texture.image_of_face):
        here = texture.image_of_face == image_index
        image = texture.images[image_index] if image_index >= 0 else None
        uv: NDArray[np.float32] = texture.uv_of_corner[here].reshape(-1, 2)
        parts.append(
            pyrender.Primitive(
                positions=mesh.vertices[mesh.faces[here]].reshape(-1, 3).astype(np.float32),
                texcoord_0=uv if image is not None else None,
                material=_flat_material(pyrender, WHITE if image is not None else NO_PICTURE, image),
            )
        )
    return parts


def _flat_material(pyrender: Any, color: Rgb, image: Bytes | None) -> Any:
    texture = None
    if image is not None:
        # OpenGL's first row is the lowest one, and so is v = 0 of our uv: pyrender turns the picture over by itself.
        texture = pyrender.Texture(source=image, source_channels="RGB")
    return pyrender.MetallicRoughnessMaterial(
        baseColorFactor=[*(c / 255 for c in color), 1.0],
        baseColorTexture=texture,
        metallicFactor=0.0,
        roughnessFactor=1.0,
        doubleSided=True,
    )
