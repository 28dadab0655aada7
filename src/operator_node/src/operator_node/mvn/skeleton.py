"""Hierarchy of the segments of a person, and operations on arrays of quaternions (n x 4, x, y, z, w)."""

import numpy as np
from scipy.spatial.transform import Rotation

from custom_ros_tools.transforms import Array

from .segments import SEGMENTS

INDEX = {name: index for index, name in enumerate(SEGMENTS)}
PARENTS = tuple(
    -1 if parent is None else INDEX[parent]
    for parent in (
        *(None, "Pelvis", "L5", "L3", "T12", "T8", "Neck"),
        *("T8", "RightShoulder", "RightUpperArm", "RightForeArm"),
        *("T8", "LeftShoulder", "LeftUpperArm", "LeftForeArm"),
        *("Pelvis", "RightUpperLeg", "RightLowerLeg", "RightFoot"),
        *("Pelvis", "LeftUpperLeg", "LeftLowerLeg", "LeftFoot"),
    )
)
"""Index of each segment's parent, -1 for the pelvis."""
BONES = np.array([(parent, child) for child, parent in enumerate(PARENTS) if parent >= 0])
"""Each bone as the pair of segments whose origins it connects, parent first (22 x 2); it is rigid, and rotates with its
parent.
"""


def multiply(a: Array, b: Array) -> Array:
    """Returns the products a b: rotation by b, then by a."""
    return np.asarray((Rotation.from_quat(a) * Rotation.from_quat(b)).as_quat())


def inverse(quats: Array) -> Array:
    """Returns the inverse of unit quaternions."""
    return quats * (-1.0, -1.0, -1.0, 1.0)


def rotate(quats: Array, vectors: Array) -> Array:
    """Returns vectors (n x 3) rotated by quaternions."""
    return np.asarray(Rotation.from_quat(quats).apply(vectors))


def heading_rad(quat: Array) -> float:
    """Returns the rotation of a unit quaternion (4) about z, as the twist of its swing-twist decomposition [rad]."""
    return float(2.0 * np.arctan2(quat[2], quat[3]))


def about_z(angle_rad: float) -> Array:
    """Returns a rotation about z, as a quaternion (4)."""
    return np.array((0.0, 0.0, np.sin(angle_rad / 2.0), np.cos(angle_rad / 2.0)))
