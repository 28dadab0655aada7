"""Poses: position and orientation of one frame expressed in another."""

from __future__ import annotations

from typing import NamedTuple

import pybullet

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class Pose(NamedTuple):
    """Pose of a frame in another.

    Attributes:
        position: x, y, z [m].
        quat_xyzw: Unit quaternion x, y, z, w.
    """

    position: Vector = (0.0, 0.0, 0.0)
    quat_xyzw: Quaternion = (0.0, 0.0, 0.0, 1.0)

    def __matmul__(self, other: Pose) -> Pose:
        """Chains poses: `pose_b_in_a @ pose_c_in_b` is the pose of c in a."""
        return Pose(*pybullet.multiplyTransforms(*self, *other))

    def inverse(self) -> Pose:
        """Returns the pose of the other frame in this one."""
        return Pose(*pybullet.invertTransform(*self))
