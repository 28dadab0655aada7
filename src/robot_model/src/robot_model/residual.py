"""Distance of a pose from its target."""

from typing import NamedTuple

POSITION_TOLERANCE_M = 1e-3
"""Largest position error of a target that counts as reached [m]."""
ORIENTATION_TOLERANCE_RAD = 0.01
"""Largest orientation error of a target that counts as reached [rad]."""


class Residual(NamedTuple):
    """Distance between a link and its target.

    Attributes:
        position_m: Distance [m].
        orientation_rad: Angle [rad]; 0 if the target has no orientation.
    """

    position_m: float
    orientation_rad: float

    @property
    def size(self) -> float:
        """Larger of both as a multiple of its tolerance: up to 1, the target counts as reached."""
        return max(self.position_m / POSITION_TOLERANCE_M, self.orientation_rad / ORIENTATION_TOLERANCE_RAD)

    def in_words(self, link: str, has_orientation: bool, target: str = "its target") -> str:
        """Returns a sentence that says whether a link has reached a target, and the errors; `has_orientation` includes
        the angle."""
        angle = f" and {self.orientation_rad:.3g} rad" if has_orientation else ""
        if self.size <= 1.0:
            return f"'{link}' is within {self.position_m * 1e3:.3g} mm{angle} of {target}"
        enough = f"{POSITION_TOLERANCE_M * 1e3:g} mm" + (f" and {ORIENTATION_TOLERANCE_RAD:g} rad" if angle else "")
        return f"'{link}' misses {target} by {self.position_m * 1e3:.4g} mm{angle}; {enough} would do"
