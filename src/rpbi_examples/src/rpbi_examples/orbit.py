"""A camera that circles a point and looks at it."""

from __future__ import annotations

import math

RADIUS = 2.0
"""Distance from the vertical axis that it circles [m]."""
HEIGHT = 1.5
"""Height above the ground [m]."""
TARGET_HEIGHT = 0.4
"""Height of what it looks at, on that axis [m]."""
SPEED = math.pi / 8.0
"""Rate of turn [rad/s]."""


def camera_pose(time_s: float) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
    """Returns position [m] and orientation (x, y, z, w) of the optical frame at a time [s].

    The optical frame has x to the right, y down and z forward.
    """
    angle = SPEED * time_s
    position = RADIUS * math.cos(angle), RADIUS * math.sin(angle), HEIGHT
    yaw = angle + math.pi / 2.0  # to the camera's right is where the circle goes, seen from its centre backwards
    tilt = -math.pi / 2.0 - math.atan2(HEIGHT - TARGET_HEIGHT, RADIUS)
    # first about x by `tilt`, which lets z point forward and down, then about the vertical by `yaw`
    sin_x, cos_x, sin_z, cos_z = math.sin(tilt / 2), math.cos(tilt / 2), math.sin(yaw / 2), math.cos(yaw / 2)
    return position, (cos_z * sin_x, sin_z * sin_x, sin_z * cos_x, cos_z * cos_x)
