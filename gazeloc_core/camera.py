"""Camera models: pixels to rays and back. THE pixel convention of GazeLoc lives here.

The centre of the first pixel is (0.5, 0.5), as in COLMAP and the AprilTag library; OpenCV, Pupil Labs and ARKit put
(0, 0) there. Readers add the half pixel once (`principal_point_from_opencv`) and nobody else does.

Models carry COLMAP's names, and pycolmap does the mathematics: FULL_OPENCV is the eight-coefficient rational model of
Pupil Invisible and Neon, whose parameters are fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pycolmap
from numpy.typing import ArrayLike

from gazeloc_core.arrays import Floats, frozen
from gazeloc_core.errors import InputError

HALF_PIXEL = 0.5


@dataclass(frozen=True, eq=False)
class Camera:
    """A calibrated camera: COLMAP model name, size in pixels and parameters, first pixel centre at (0.5, 0.5)."""

    model: str
    width: int
    height: int
    params: Floats

    def __post_init__(self) -> None:
        params = frozen(self.params)
        object.__setattr__(self, "params", params)
        if self.model not in pycolmap.CameraModelId.__members__:
            raise InputError(f"The camera model {self.model!r} is unknown; use one of COLMAP's, e.g. FULL_OPENCV.")
        if self.width <= 0 or self.height <= 0:
            raise InputError(f"The camera is {self.width}x{self.height} pixels; both must be above 0.")
        if not np.isfinite(params).all() or params.ndim != 1:
            raise InputError(f"The camera's parameters must be finite numbers, got {params.tolist()}.")
        expected = pycolmap.Camera.create_from_model_name(0, self.model, 1.0, self.width, self.height).params
        if len(expected) != len(params):
            raise InputError(f"The camera model {self.model} has {len(expected)} parameters, got {len(params)}.")
        if (self.focal_px <= 0).any():
            raise InputError(f"The camera's focal length is {self.focal_px.tolist()} px; it must be above 0.")

    @classmethod
    def pinhole(cls, width: int, height: int, fx: float, fy: float, cx: float, cy: float) -> Camera:
        """A camera without distortion; `cx`, `cy` with the first pixel centre at (0.5, 0.5)."""
        return cls("PINHOLE", width, height, np.array([fx, fy, cx, cy]))

    @classmethod
    def from_opencv(cls, width: int, height: int, matrix: ArrayLike, distortion: ArrayLike) -> Camera:
        """A camera of OpenCV's: matrix (3, 3) with the first pixel centre at (0, 0), and 0, 4, 5 or 8 coefficients.

        Raises:
            InputError: if the matrix has skew or another shape, or the number of coefficients is not one of these.
        """
        k = np.asarray(matrix, dtype=np.float64)
        d = np.asarray(distortion, dtype=np.float64).ravel()
        if k.shape != (3, 3):
            raise InputError(f"A camera matrix has 3 rows and 3 columns, got shape {k.shape}.")
        if abs(k[0, 1]) > 1e-6 * abs(k[0, 0]):
            raise InputError(f"The camera matrix has a skew of {k[0, 1]}; cameras with skew are not supported.")
        if len(d) not in (0, 4, 5, 8):
            raise InputError(f"A camera has 0, 4, 5 or 8 distortion coefficients, got {len(d)}.")
        head = [k[0, 0], k[1, 1], k[0, 2] + HALF_PIXEL, k[1, 2] + HALF_PIXEL]
        if len(d) == 0:
            return cls("PINHOLE", width, height, np.array(head))
        return cls("FULL_OPENCV", width, height, np.array([*head, *d, *np.zeros(8 - len(d))]))

    @property
    def focal_px(self) -> Floats:
        """Focal lengths fx, fy, shape (2,)."""
        fx, fy = (self.params[i] for i in (self._colmap.focal_length_idxs() * 2)[:2])
        return np.array([fx, fy])

    @property
    def principal_point_px(self) -> Floats:
        """Principal point cx, cy, shape (2,), first pixel centre at (0.5, 0.5)."""
        return np.array([self._colmap.principal_point_x, self._colmap.principal_point_y])

    @property
    def matrix(self) -> Floats:
        """The 3x3 matrix of focal lengths and principal point, in our pixel convention."""
        (fx, fy), (cx, cy) = self.focal_px, self.principal_point_px
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])

    @property
    def is_pinhole(self) -> bool:
        """Whether the camera has no distortion by its model's name."""
        return self.model in ("PINHOLE", "SIMPLE_PINHOLE")

    @cached_property
    def _colmap(self) -> Any:
        return pycolmap.Camera(model=self.model, width=self.width, height=self.height, params=self.params)

    def to_colmap(self, camera_id: int = 1) -> Any:
        """A new `pycolmap.Camera` that is this one."""
        return pycolmap.Camera(
            camera_id=camera_id, model=self.model, width=self.width, height=self.height, params=self.params
        )

    @classmethod
    def from_colmap(cls, camera: Any) -> Camera:
        """This type for a `pycolmap.Camera`."""
        return cls(camera.model.name, int(camera.width), int(camera.height), np.asarray(camera.params))

    def project(self, points_in_camera: ArrayLike) -> Floats:
        """Pixels (N, 2) of points (N, 3); NaN for points that are not in front of the camera."""
        points = np.asarray(points_in_camera, dtype=np.float64).reshape(-1, 3)
        pixels = np.full((len(points), 2), np.nan)
        ahead = points[:, 2] > 1e-9
        pixels[ahead] = self._colmap.img_from_cam(points[ahead])
        return pixels

    def unproject(self, pixels: ArrayLike) -> Floats:
        """Unit rays in the camera (N, 3) through pixels (N, 2); NaN where the lens model has no answer."""
        normalised = self._colmap.cam_from_img(np.asarray(pixels, dtype=np.float64).reshape(-1, 2))
        rays = np.column_stack([normalised, np.ones(len(normalised))])
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        return np.asarray(rays, dtype=np.float64)

    def contains(self, pixels: ArrayLike) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """Whether each pixel (N, 2) lies in the image; NaN does not."""
        p = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
        inside = (p >= 0).all(axis=1) & (p[:, 0] <= self.width) & (p[:, 1] <= self.height)
        return np.asarray(inside, dtype=np.bool_)

    def pixel_centres(self) -> Floats:
        """The centre of every pixel, shape (height * width, 2), row by row."""
        x, y = np.meshgrid(np.arange(self.width) + HALF_PIXEL, np.arange(self.height) + HALF_PIXEL)
        return np.column_stack([x.ravel(), y.ravel()])

    def scaled(self, width: int, height: int) -> Camera:
        """The same camera for images resized to `width` x `height`."""
        camera = self.to_colmap()
        camera.rescale(width, height)
        return Camera.from_colmap(camera)

    def to_json(self) -> dict[str, Any]:
        """A JSON object that `from_json` reads."""
        return {
            "model": self.model,
            "width": self.width,
            "height": self.height,
            "params": self.params.tolist(),
            "pixel_centre": HALF_PIXEL,
        }

    @classmethod
    def from_json(cls, value: dict[str, Any]) -> Camera:
        """The camera of `to_json`.

        Raises:
            InputError: if a field is missing or the pixel convention is another one.
        """
        try:
            if value["pixel_centre"] != HALF_PIXEL:
                raise InputError(
                    f"The camera has its first pixel centre at {value['pixel_centre']}; expected {HALF_PIXEL}."
                )
            return cls(value["model"], int(value["width"]), int(value["height"]), np.array(value["params"], float))
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"The camera description lacks or garbles the field {error}.") from error
