"""How the segments of a person hang together, and quaternions of all of them at once (n x 4, x, y, z, w)."""

import numpy as np

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
"""Index of the segment that each hangs on, -1 for the pelvis."""
BONES = np.array([(parent, child) for child, parent in enumerate(PARENTS) if parent >= 0])
"""Each bone as the segments whose origins it joins, parent first (22 x 2); it is rigid, and turns with its parent."""


def multiply(a: Array, b: Array) -> Array:
    """Returns the rotations b, then a."""
    ax, ay, az, aw = a.T
    bx, by, bz, bw = b.T
    return np.array(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ]
    ).T


def inverse(quats: Array) -> Array:
    """Returns the inverse of unit quaternions."""
    return quats * (-1.0, -1.0, -1.0, 1.0)


def rotate(quats: Array, vectors: Array) -> Array:
    """Returns vectors (n x 3) turned by quaternions."""
    u, w = quats[:, :3], quats[:, 3:]
    t = 2.0 * np.cross(u, vectors)
    return vectors + w * t + np.cross(u, t)


def heading_rad(quat: Array) -> float:
    """Returns how far a unit quaternion (4) turns about z, as the twist of swing and twist [rad]."""
    return float(2.0 * np.arctan2(quat[2], quat[3]))


def about_z(angle_rad: float) -> Array:
    """Returns a rotation about z (4)."""
    return np.array((0.0, 0.0, np.sin(angle_rad / 2.0), np.cos(angle_rad / 2.0)))
