"""Distance of a pose from its target."""

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

    def in_words(self, link: str, has_orientation: bool, target: str = "its target") -> str:
        """Returns whether a link has reached a target, maybe of its orientation too, and how far off it is."""
        angle = f" and {self.orientation_rad:.3g} rad" if has_orientation else ""
        if self.size <= 1.0:
            return f"'{link}' is within {self.position_m * 1e3:.3g} mm{angle} of {target}"
        enough = f"{POSITION_TOLERANCE_M * 1e3:g} mm" + (f" and {ORIENTATION_TOLERANCE_RAD:g} rad" if angle else "")
        return f"'{link}' misses {target} by {self.position_m * 1e3:.4g} mm{angle}; {enough} would do"
