"""An avatar that never jumps."""

import math

import numpy as np

from .anthropometry import Array
from .retargeting import AvatarPose

LONGEST_STEP_S = 0.1
"""More time than that between two frames counts as so much [s]."""


class Engagement:
    """Takes the avatar to where it is to be at limited speeds: from where it was at the start, after a pause, always.

    Args:
        max_joint_speed: Of each hinge [rad/s].
        max_speed: Of the pelvis [m/s].
        max_angular_speed: Of the pelvis [rad/s].
    """

    def __init__(self, max_joint_speed: float, max_speed: float, max_angular_speed: float) -> None:
        self._joint_speed, self._speed, self._angular_speed = max_joint_speed, max_speed, max_angular_speed
        self._last: AvatarPose | None = None

    def begin(self, pose: AvatarPose) -> None:
        """Says where the avatar is; the next step begins there."""
        self._last = pose

    def step(self, target: AvatarPose, dt: float) -> AvatarPose:
        """Returns where the avatar is to be now.

        Args:
            target: Where it is to get to.
            dt: Time since the last step [s].
        """
        if self._last is None:
            self._last = target
        last, dt = self._last, min(dt, LONGEST_STEP_S)
        hinge_step, way = self._joint_speed * dt, target.position - last.position
        distance = float(np.linalg.norm(way))
        position = last.position + way * min(1.0, self._speed * dt / max(distance, 1e-12))
        hinges = last.hinges + np.clip(target.hinges - last.hinges, -hinge_step, hinge_step)
        quat = _turned(last.quat_xyzw, target.quat_xyzw, self._angular_speed * dt)
        self._last = AvatarPose(position, quat, hinges)
        return self._last


def _turned(start: Array, end: Array, most_rad: float) -> Array:
    """Returns a quaternion on the short way from one to another, at most an angle from the first [rad]."""
    cosine = float(np.dot(start, end))
    if cosine < 0.0:
        end, cosine = -end, -cosine
    half = math.acos(min(cosine, 1.0))
    if 2.0 * half <= most_rad:
        return end
    share = most_rad / (2.0 * half)
    quat = (math.sin((1.0 - share) * half) * start + math.sin(share * half) * end) / math.sin(half)
    return np.asarray(quat / np.linalg.norm(quat))
