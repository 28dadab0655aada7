"""Twists: how fast a frame moves and turns."""

from __future__ import annotations

from typing import NamedTuple

from .pose import Quaternion, Vector
from .vectors import rotated_back


class Twist(NamedTuple):
    """Velocity of a frame's origin and rotation of the frame.

    Attributes:
        linear: x, y, z [m/s].
        angular: About x, y, z [rad/s].
    """

    linear: Vector = (0.0, 0.0, 0.0)
    angular: Vector = (0.0, 0.0, 0.0)

    def seen_from(self, quat_xyzw: Quaternion) -> Twist:
        """Returns the same twist in the axes of a frame of that orientation."""
        return Twist(rotated_back(quat_xyzw, self.linear), rotated_back(quat_xyzw, self.angular))
