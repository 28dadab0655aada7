"""The space that a chain of joints reaches."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from .geometry import Vector
from .limits import Axis
from .residual import POSITION_TOLERANCE_M


class Reach(NamedTuple):
    """Ball that contains all positions of the tip of a chain of joints.

    Attributes:
        anchor: Its centre, the position of the first moving joint in the base [m].
        radius_m: Its radius [m], inf for endless rails.
    """

    anchor: Vector
    radius_m: float

    @classmethod
    def of(cls, anchor: Vector, lengths: Iterable[float], joints: Iterable[Axis]) -> Reach:
        """Returns the reach of a chain of moving joints.

        Args:
            anchor: See above.
            lengths: Distances from each joint to the next one, and to the tip [m].
        """
        travel = [max(abs(joint.lower), abs(joint.upper)) for joint in joints if not joint.is_revolute]
        return cls(anchor, sum(lengths) + sum(travel))

    def covers(self, position: Sequence[float], tolerance_m: float = 0.0) -> bool:
        """Returns whether the tip may reach a position in the base [m] within the tolerance of success.

        Args:
            tolerance_m: Further distance from the position that is accepted [m].
        """
        return math.dist(position, self.anchor) <= self.radius_m + tolerance_m + POSITION_TOLERANCE_M
