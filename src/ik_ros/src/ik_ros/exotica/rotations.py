"""Rotations in EXOTica's notations."""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from robot_model.geometry import Quaternion


def _checked_quaternion(numbers: Sequence[float]) -> Rotation:
    if math.hypot(*numbers) < 1e-6:
        raise ValueError("expected a quaternion x, y, z, w that is not zero")
    return Rotation.from_quat(numbers)


def _checked_matrix(numbers: Sequence[float]) -> Rotation:
    matrix = np.array(numbers).reshape(3, 3)
    if not np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-3) or np.linalg.det(matrix) < 0.0:
        raise ValueError("expected the nine numbers of a rotation matrix, row by row")
    return Rotation.from_matrix(matrix)


NOTATIONS: Mapping[str, tuple[int, Callable[[Sequence[float]], Rotation]]] = {
    "RPY": (3, lambda numbers: Rotation.from_euler("xyz", numbers)),
    "ZYX": (3, lambda numbers: Rotation.from_euler("ZYX", numbers)),
    "ZYZ": (3, lambda numbers: Rotation.from_euler("ZYZ", numbers)),
    "AngleAxis": (3, Rotation.from_rotvec),
    "Quaternion": (4, _checked_quaternion),
    "Matrix": (9, _checked_matrix),
}
"""Count of numbers of each notation, and their rotation."""


def rotation_of(notation: str, numbers: Sequence[float]) -> Quaternion:
    """Returns the quaternion x, y, z, w of a rotation in one of the `NOTATIONS`.

    Raises:
        ValueError: If the numbers are no rotation, or are too many or too few.
    """
    count, make = NOTATIONS[notation]
    if len(numbers) != count:
        raise ValueError(f"expected {count} numbers for a rotation as {notation}, got {len(numbers)}")
    x, y, z, w = make(numbers).as_quat().tolist()
    return x, y, z, w
