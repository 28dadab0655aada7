"""How far a pose is from where it should be."""

from __future__ import annotations

from typing import NamedTuple

POSITION_TOLERANCE_M = 1e-3
"""A target counts as reached within this distance [m]..."""
ORIENTATION_TOLERANCE_RAD = 0.01
"""... and this angle [rad]."""


class Residual(NamedTuple):
    """Distance between a link and its target.

    Attributes:
        position_m: Distance [m].
        orientation_rad: Angle [rad]; 0 if no orientation is asked for.
    """

    position_m: float
    orientation_rad: float

    @property
    def size(self) -> float:
        """The larger of both in tolerances: up to 1, the target counts as reached."""
        return max(self.position_m / POSITION_TOLERANCE_M, self.orientation_rad / ORIENTATION_TOLERANCE_RAD)
