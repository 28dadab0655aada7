"""Converts rotations and poses between quaternions, roll-pitch-yaw and matrices.

Quaternions are in the order x, y, z, w. Roll, pitch and yaw are rotations about the fixed x, y and z axes, in this
order, as in URDF.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import model_validator
from scipy.spatial.transform import Rotation

from .errors import ConfigError, Problem
from .schema import ConfigModel, FrameId, KeyedError, Position, Quat

Array = NDArray[np.float64]

MATRIX_TOLERANCE = 1e-3
"""Largest accepted deviation of R R^T from the identity matrix, entry by entry, for a rotation matrix R."""
MIN_NORM = 1e-6
"""Smallest length of a quaternion; shorter quaternions count as zero."""


def finite_vector(values: ArrayLike, length: int, name: str) -> Array:
    """Converts numbers to an array of shape (length,), and checks that they are finite.

    Args:
        values: The numbers.
        length: Required number of values.
        name: Name of the values in error messages.

    Raises:
        ValueError: If the number of values is wrong, or a value is not finite.
    """
    vector = np.asarray(values, dtype=float)
    if vector.shape != (length,):
        raise ValueError(f"{name}: expected {length} numbers, got shape {vector.shape}")
    if not np.isfinite(vector).all():
        raise ValueError(f"{name}: must be finite, got {', '.join(f'{v:g}' for v in vector)}")
    return vector


def unit_quat(quat_xyzw: ArrayLike) -> Array:
    """Scales a quaternion x, y, z, w to length 1.

    Raises:
        ValueError: If the quaternion is not four finite numbers, or its length is below 1e-6.
    """
    quat = finite_vector(quat_xyzw, 4, "quaternion")
    norm = np.linalg.norm(quat)
    if norm < MIN_NORM:
        raise ValueError("quaternion: must not be zero; no rotation is 0, 0, 0, 1")
    return np.asarray(quat / norm)


def quat_of(orientation: ArrayLike, in_deg: bool = False) -> Array:
    """Converts an orientation to a unit quaternion x, y, z, w.

    Args:
        orientation: Roll, pitch and yaw, or a quaternion x, y, z, w.
        in_deg: Whether roll, pitch and yaw are in degrees instead of radians; has no effect on a quaternion.

    Raises:
        ValueError: If the orientation is not three or four finite numbers, or is a zero quaternion.
    """
    values = np.asarray(orientation, dtype=float)
    if values.shape == (4,):
        return unit_quat(values)
    if values.shape != (3,):
        raise ValueError(f"orientation: expected roll, pitch, yaw or a quaternion x, y, z, w, got shape {values.shape}")
    rpy = finite_vector(values, 3, "roll, pitch, yaw")
    return np.asarray(Rotation.from_euler("xyz", rpy, degrees=in_deg).as_quat())


def rpy_of(quat_xyzw: ArrayLike) -> Array:
    """Converts a quaternion x, y, z, w to roll, pitch, yaw [rad]; pitch is from -pi/2 to pi/2.

    Raises:
        ValueError: If the quaternion is not four finite numbers, or is zero.
    """
    return np.asarray(Rotation.from_quat(unit_quat(quat_xyzw)).as_euler("xyz"))


def yaw_of(quat_xyzw: Sequence[float] | Array) -> float:
    """Returns the yaw of a unit quaternion x, y, z, w [rad]: the angle of the rotated x axis in the x-y plane."""
    x, y, z, w = quat_xyzw
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def matrix_of(position: ArrayLike, quat_xyzw: ArrayLike) -> Array:
    """Converts a position x, y, z [m] and a quaternion x, y, z, w to a homogeneous matrix, shape (4, 4).

    Raises:
        ValueError: If the count of numbers is wrong, a number is not finite, or the quaternion is zero.
    """
    T = np.eye(4)
    T[:3, :3] = Rotation.from_quat(unit_quat(quat_xyzw)).as_matrix()
    T[:3, 3] = finite_vector(position, 3, "position")
    return T


def pose_of(matrix: ArrayLike) -> tuple[Array, Array]:
    """Converts a homogeneous matrix, shape (4, 4), to a position x, y, z [m] and a unit quaternion x, y, z, w.

    Raises:
        ValueError: If the matrix is not a rigid transform; rounding errors up to `MATRIX_TOLERANCE` are accepted.
    """
    T = np.asarray(matrix, dtype=float)
    if T.shape != (4, 4):
        raise ValueError(f"matrix: expected shape (4, 4), got {T.shape}")
    if not np.isfinite(T).all():
        raise ValueError("matrix: must be finite")
    R = T[:3, :3]
    is_rotation = np.allclose(R @ R.T, np.eye(3), atol=MATRIX_TOLERANCE) and np.linalg.det(R) > 0
    if not is_rotation or not np.allclose(T[3], (0, 0, 0, 1)):
        raise ValueError("matrix: expected a rotation, a translation and the last row 0, 0, 0, 1")
    return T[:3, 3].copy(), np.asarray(Rotation.from_matrix(R).as_quat())


_ARGUMENTS = "arguments"
_KEYS = {
    8: ("x", "y", "z", "roll", "pitch", "yaw", "PARENT", "CHILD"),
    9: ("x", "y", "z", "qx", "qy", "qz", "qw", "PARENT", "CHILD"),
}


class StaticTransform(ConfigModel):
    """A fixed transform between two frames, given by the arguments of a command."""

    parent: FrameId
    child: FrameId
    position: Position
    quat_xyzw: Quat

    @model_validator(mode="after")
    def _between_two_frames(self) -> StaticTransform:
        if self.parent == self.child:
            raise KeyedError("child", f"must be another frame than the parent, got '{self.child}' for both")
        return self

    @classmethod
    def from_arguments(cls, arguments: Sequence[str]) -> StaticTransform:
        """Parses the arguments of a command line.

        Args:
            arguments: `x y z roll pitch yaw PARENT CHILD` or `x y z qx qy qz qw PARENT CHILD` [m and rad].

        Raises:
            ConfigError: If arguments are invalid; the error contains a `Problem` for each fault.
        """
        keys = _KEYS.get(len(arguments))
        if keys is None:
            wanted = " or ".join(f"'{' '.join(keys)}'" for keys in _KEYS.values())
            got = f"{len(arguments)} arguments" if arguments else "none"
            raise ConfigError([Problem(_ARGUMENTS, "", f"expected {wanted}, got {got}")])
        problems: list[Problem] = []
        numbers = [1.0] * (len(keys) - 2)  # placeholders for invalid values, so that the other values are checked
        for index, text in enumerate(arguments[:-2]):
            try:
                numbers[index] = float(text)
            except ValueError:
                problems.append(Problem(_ARGUMENTS, keys[index], f"expected a number, got {text!r}"))
        data: dict[str, Any] = {"parent": arguments[-2], "child": arguments[-1], "position": numbers[:3]}
        try:
            data["quat_xyzw"] = quat_of(numbers[3:]).tolist()
        except ValueError as error:
            problems.append(Problem(_ARGUMENTS, "", str(error)))
            data["quat_xyzw"] = [0.0, 0.0, 0.0, 1.0]  # placeholder
        try:
            transform = cls.parse(data, _ARGUMENTS)
        except ConfigError as error:
            problems += error.problems
        if problems:
            raise ConfigError(problems)
        return transform
