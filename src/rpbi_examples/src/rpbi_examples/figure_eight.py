"""A figure eight."""

from __future__ import annotations

import math

WIDTH = 0.8
"""From end to end, along y [m]."""
HEIGHT = 0.4
"""Height of each loop, along x [m]."""
PERIOD_S = 8.0
"""Time of one round [s]."""


def position(time_s: float) -> tuple[float, float, float]:
    """Returns where the figure is at a time [s], in its x-y plane [m]: a lemniscate of Gerono."""
    angle = 2.0 * math.pi * time_s / PERIOD_S
    return HEIGHT * math.sin(angle) * math.cos(angle), WIDTH / 2.0 * math.sin(angle), 0.0
