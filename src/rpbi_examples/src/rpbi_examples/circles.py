"""Mirrored circles that two hands draw."""

from __future__ import annotations

import math

RADIUS = 0.12
"""Radius of the circles [m]."""
PERIOD_S = 6.0
"""Time of one round [s]."""
CENTRE = (0.55, 0.30, 0.85)
"""Centre of the left hand's circle in the world [m]; the right hand's has the opposite y."""
POINTING_DOWN = (0.0, 1.0, 0.0, 0.0)
"""Orientation of the hands as x, y, z, w: their z axis down."""


def hand_position(time_s: float, side: float) -> tuple[float, float, float]:
    """Returns where a hand is to be [m] at a time since the start [s].

    Args:
        time_s: The time.
        side: 1 for the left hand, -1 for the right one.
    """
    angle = 2.0 * math.pi * time_s / PERIOD_S
    x, y, z = CENTRE
    return x, side * (y + RADIUS * math.sin(angle)), z + RADIUS * (1.0 - math.cos(angle))
