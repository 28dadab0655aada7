"""Checks whether a chain of joints can reach a target pose, and measures the error between a link and its target."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from .geometry import Vector
from .limits import Axis

POSITION_TOLERANCE_M = 1e-3
"""Largest position error of a target that counts as reached [m]."""
ORIENTATION_TOLERANCE_RAD = 0.01
"""Largest orientation error of a target that counts as reached [rad]."""


class Reach(NamedTuple):
    """Ball that contains all positions of the tip of a chain of joints.

    Attributes:
        anchor: Centre of the ball: the position of the first moving joint in the base frame [m].
        radius_m: Radius of the ball [m]; inf if a prismatic joint has no limits.
    """

    anchor: Vector
    radius_m: float

    @classmethod
    def of(cls, anchor: Vector, lengths: Iterable[float], joints: Iterable[Axis]) -> Reach:
        """Computes the ball for a chain of joints.

        Args:
            anchor: Position of the first moving joint in the base frame [m].
            lengths: Distance from each joint to the next joint, and from the last joint to the tip [m].
            joints: The moving joints of the chain.
        """
        travel = [max(abs(joint.lower), abs(joint.upper)) for joint in joints if not joint.is_revolute]
        return cls(anchor, sum(lengths) + sum(travel))

    def covers(self, position: Sequence[float], tolerance_m: float = 0.0) -> bool:
        """Returns whether a position in the base frame [m] is within the ball. The tip cannot reach other positions.

        `POSITION_TOLERANCE_M` and `tolerance_m` are added to the radius.
        """
        return math.dist(position, self.anchor) <= self.radius_m + tolerance_m + POSITION_TOLERANCE_M


class Residual(NamedTuple):
    """Position and orientation error between a link and its target pose.

    Attributes:
        position_m: Distance between the positions [m].
        orientation_rad: Angle between the orientations [rad]; 0 if the target has no orientation.
    """

    position_m: float
    orientation_rad: float

    @property
    def size(self) -> float:
        """The larger of the two errors, each divided by its tolerance. A target counts as reached up to a size of 1."""
        return max(self.position_m / POSITION_TOLERANCE_M, self.orientation_rad / ORIENTATION_TOLERANCE_RAD)

    def in_words(self, link: str, has_orientation: bool, target: str = "its target") -> str:
        """Returns a sentence that says whether a link has reached a target, and states the errors.

        Args:
            link: Name of the link.
            has_orientation: Whether the sentence includes the orientation error.
            target: Words that stand for the target in the sentence.
        """
        angle = f" and {self.orientation_rad:.3g} rad" if has_orientation else ""
        if self.size <= 1.0:
            return f"'{link}' is within {self.position_m * 1e3:.3g} mm{angle} of {target}"
        enough = f"{POSITION_TOLERANCE_M * 1e3:g} mm" + (f" and {ORIENTATION_TOLERANCE_RAD:g} rad" if angle else "")
        return f"'{link}' misses {target} by {self.position_m * 1e3:.4g} mm{angle}; {enough} would do"
