"""Rigid transforms and similarities between the frames `scan`, `sfm`, `camera` and `tag`.

`a_from_b` maps coordinates in b to coordinates in a, and products read as cancellation:
`scan_from_camera = scan_from_sfm.compose_pose(sfm_from_camera)`. Rigid transforms are SciPy's `RigidTransform`, made
only by the checked constructors here: SciPy's own repairs a sheared matrix in silence and accepts NaN.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import RigidTransform, Rotation, Slerp

from gazeloc_core.arrays import Floats, frozen
from gazeloc_core.errors import GeometryError

ORTHOGONALITY_TOLERANCE = 1e-3
"""Largest entry of |R Rᵀ - 1| that still counts as a rotation written with few digits."""


def rotation_from_matrix(matrix: ArrayLike, what: str = "rotation") -> Rotation:
    """The rotation of one or many matrices, shape (..., 3, 3), refused unless each really is a rotation.

    Raises:
        GeometryError: if a matrix is not finite, not orthogonal, or mirrors; `what` names it in the sentence.
    """
    array = np.asarray(matrix, dtype=np.float64)
    if array.shape[-2:] != (3, 3):
        raise GeometryError(f"{what} has shape {array.shape}; a rotation matrix has 3 rows and 3 columns.")
    if not np.isfinite(array).all():
        raise GeometryError(f"{what} holds values that are not finite; the pose cannot be used.")
    error = np.abs(array @ np.swapaxes(array, -1, -2) - np.eye(3)).max(initial=0.0)
    if error > ORTHOGONALITY_TOLERANCE:
        raise GeometryError(
            f"{what} is not a rotation: its rows are off orthonormal by {error:.3g}; "
            "check whether the file stores it scaled, sheared or transposed with its translation."
        )
    if (np.linalg.det(array) < 0).any():
        raise GeometryError(f"{what} mirrors space (determinant -1); check the axis convention of the file.")
    return Rotation.from_matrix(array)


def rigid_from_matrix(matrix: ArrayLike, what: str = "pose") -> RigidTransform:
    """The rigid transform of one or many 4x4 (or 3x4) matrices, shape (..., 4, 4), in metres.

    Raises:
        GeometryError: if the rotation part is not a rotation, anything is not finite, or the last row is not 0 0 0 1.
    """
    array = np.asarray(matrix, dtype=np.float64)
    if array.shape[-2:] not in ((4, 4), (3, 4)):
        raise GeometryError(f"{what} has shape {array.shape}; a pose is a 4x4 matrix.")
    if array.shape[-2] == 4 and not np.allclose(array[..., 3, :], (0, 0, 0, 1), atol=ORTHOGONALITY_TOLERANCE):
        raise GeometryError(
            f"{what} has the last row {array[..., 3, :].reshape(-1, 4)[0]}; expected 0 0 0 1, "
            "check whether the file is column-major."
        )
    rotation = rotation_from_matrix(array[..., :3, :3], what)
    return rigid(rotation, array[..., :3, 3], what)


def rigid_from_wxyz(wxyz: ArrayLike, translation: ArrayLike, what: str = "pose") -> RigidTransform:
    """The rigid transform of unit quaternions (..., 4) in the order w x y z and translations (..., 3) in metres.

    Raises:
        GeometryError: if a quaternion's length is off 1 by more than 1 %, or anything is not finite.
    """
    quaternions = np.asarray(wxyz, dtype=np.float64)
    if quaternions.shape[-1:] != (4,) or not np.isfinite(quaternions).all():
        raise GeometryError(f"{what} needs four finite quaternion values, got {quaternions.tolist()}.")
    lengths = np.linalg.norm(quaternions, axis=-1)
    if (np.abs(lengths - 1) > 0.01).any():
        worst = float(np.atleast_1d(lengths)[np.abs(np.atleast_1d(lengths) - 1).argmax()])
        raise GeometryError(f"{what} has a quaternion of length {worst:.4g}; a rotation needs length 1.")
    return rigid(Rotation.from_quat(quaternions[..., [1, 2, 3, 0]]), translation, what)


def rigid(rotation: Rotation, translation: ArrayLike, what: str = "pose") -> RigidTransform:
    """The rigid transform of a rotation and a translation (..., 3) in metres.

    Raises:
        GeometryError: if the translation is not finite.
    """
    offset = np.asarray(translation, dtype=np.float64)
    if offset.shape[-1:] != (3,) or not np.isfinite(offset).all():
        raise GeometryError(f"{what} has a translation that is not three finite numbers: {offset.tolist()}.")
    return RigidTransform.from_components(offset, rotation)


def wxyz_of(rotation: Rotation) -> Floats:
    """The quaternions (..., 4) of a rotation in the order w x y z, w >= 0."""
    xyzw = rotation.as_quat(canonical=True)
    return np.asarray(xyzw[..., [3, 0, 1, 2]], dtype=np.float64)


def rotation_angle_rad(first: Rotation, second: Rotation) -> Floats:
    """The angle between two rotations, arccos((trace(R1ᵀ R2) - 1) / 2) (the paper, section VI-B), shape (...,).

    Computed from the quaternion, which keeps its digits where the arccos loses them (near zero).
    """
    return np.asarray((first.inv() * second).magnitude(), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Similarity:
    """`a_from_b` with scale: x_in_a = scale * rotation(x_in_b) + translation. Maps a reconstruction into the scan."""

    scale: float
    rotation: Rotation
    translation: Floats

    def __post_init__(self) -> None:
        translation = frozen(self.translation)
        finite = np.isfinite(self.scale) and np.isfinite(translation).all()
        if translation.shape != (3,) or not finite or self.scale <= 0:
            raise GeometryError(
                f"A similarity needs a positive scale and three finite offsets, got scale {self.scale} and "
                f"translation {translation.tolist()}."
            )
        object.__setattr__(self, "scale", float(self.scale))
        object.__setattr__(self, "translation", translation)

    @classmethod
    def identity(cls) -> Similarity:
        """The similarity that changes nothing."""
        return cls(1.0, Rotation.identity(), np.zeros(3))

    @classmethod
    def from_rigid(cls, transform: RigidTransform, scale: float = 1.0) -> Similarity:
        """The similarity with the rotation and translation of one rigid transform."""
        return cls(scale, transform.rotation, transform.translation)

    @classmethod
    def from_matrix(cls, matrix: ArrayLike, what: str = "similarity") -> Similarity:
        """The similarity of a 4x4 matrix whose upper left part is a scaled rotation."""
        array = np.asarray(matrix, dtype=np.float64)
        if array.shape != (4, 4) or not np.isfinite(array).all():
            raise GeometryError(f"{what} needs a finite 4x4 matrix, got shape {array.shape}.")
        determinant = float(np.linalg.det(array[:3, :3]))
        if determinant <= 0:
            raise GeometryError(f"{what} mirrors space or flattens it (determinant {determinant:.3g}).")
        scale = determinant ** (1 / 3)
        return cls(scale, rotation_from_matrix(array[:3, :3] / scale, what), array[:3, 3])

    def as_matrix(self) -> Floats:
        """The 4x4 matrix."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.scale * self.rotation.as_matrix()
        matrix[:3, 3] = self.translation
        return matrix

    def apply(self, points: ArrayLike) -> Floats:
        """Points (..., 3) in b, mapped to a."""
        array = np.asarray(points, dtype=np.float64)
        return np.asarray(self.scale * array @ self.rotation.as_matrix().T + self.translation, dtype=np.float64)

    def inverse(self) -> Similarity:
        """`b_from_a`."""
        back = self.rotation.inv()
        return Similarity(1 / self.scale, back, -(back.as_matrix() @ self.translation) / self.scale)

    def __mul__(self, other: Similarity) -> Similarity:
        """`a_from_c = a_from_b * b_from_c`."""
        return Similarity(self.scale * other.scale, self.rotation * other.rotation, self.apply(other.translation))

    def compose_pose(self, b_from_camera: RigidTransform) -> RigidTransform:
        """`a_from_camera` of one or many poses: cameras have no size, so the scale moves only their centres."""
        return rigid(self.rotation * b_from_camera.rotation, self.apply(b_from_camera.translation))


def interpolate_poses(times: Floats, poses: RigidTransform, at: Floats) -> RigidTransform:
    """Poses at the times `at` (M,), linear in position and by slerp in rotation between `poses` at `times` (N,).

    `times` must rise strictly and `at` lie within them.
    """
    if len(times) == 1:
        return RigidTransform.concatenate([poses[0]] * len(at))
    translation = np.column_stack([np.interp(at, times, column) for column in poses.translation.T])
    return RigidTransform.from_components(translation, Slerp(times, poses.rotation)(at))
