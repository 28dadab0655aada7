"""Speed limits that keep an avatar from jumping."""

import numpy as np
from scipy.spatial.transform import Rotation

from .anthropometry import Array
from .retargeting import AvatarPose

MAX_STEP_S = 0.1
"""Longest time that counts between two frames [s]; the rest is dropped."""


class Engagement:
    """Moves the avatar to its target pose at limited speeds, at the start, after a pause, and at any other time.

    Args:
        max_joint_speed: Largest speed of each hinge [rad/s].
        max_speed: Largest speed of the pelvis [m/s].
        max_angular_speed: Largest angular speed of the pelvis [rad/s].
    """

    def __init__(self, max_joint_speed: float, max_speed: float, max_angular_speed: float) -> None:
        self._joint_speed, self._speed, self._angular_speed = max_joint_speed, max_speed, max_angular_speed
        self._last: AvatarPose | None = None

    def begin(self, pose: AvatarPose) -> None:
        """Sets the present pose of the avatar, from which the next step starts."""
        self._last = pose

    def step(self, target: AvatarPose, dt: float) -> AvatarPose:
        """Returns the next pose of the avatar.

        Args:
            target: Its target pose.
            dt: Time since the last step [s].
        """
        if self._last is None:
            self._last = target
        last, dt = self._last, min(dt, MAX_STEP_S)
        hinge_step, way = self._joint_speed * dt, target.position - last.position
        distance = float(np.linalg.norm(way))
        position = last.position + way * min(1.0, self._speed * dt / max(distance, 1e-12))
        hinges = last.hinges + np.clip(target.hinges - last.hinges, -hinge_step, hinge_step)
        quat = _turned(last.quat_xyzw, target.quat_xyzw, self._angular_speed * dt)
        self._last = AvatarPose(position, quat, hinges)
        return self._last


def _turned(start: Array, end: Array, most_rad: float) -> Array:
    """Returns a quaternion on the shortest path between two, limited to an angle from the first [rad]."""
    first = Rotation.from_quat(start)
    way = (first.inv() * Rotation.from_quat(end)).as_rotvec()
    angle = float(np.linalg.norm(way))
    if angle <= most_rad:
        return end
    return np.asarray((first * Rotation.from_rotvec(way * (most_rad / angle))).as_quat())
