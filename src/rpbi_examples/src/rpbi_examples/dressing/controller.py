"""The controller that draws the sleeve over the arm: where the hand goes, and how fast."""

from __future__ import annotations

import numpy as np

from .hand import HandTarget, holding
from .way import AHEAD_AT_START, ArmPosition, Array, Way

TARGET_HZ = 50
"""Targets a second."""
SETTLING_S = 0.5
"""Time for which the cuff is held at the end of its path [s]."""
MAX_LEAD_M = 0.02
"""Largest distance of the cuff's target from the cuff [m]; the target waits until the cuff is within it."""
MAX_TURN_RATE = 1.5
"""Largest angular speed of the cuff [rad/s]."""


class Dressing:
    """Moves the cuff along a person's arm and follows the arm's motion.

    The cuff slows down as a force on the arm approaches its limit, and moves back above it. It waits for a hand that
    does not follow, so that the hand does not move far at once afterwards.

    Args:
        speed: Speed of the cuff without contact [m/s].
    """

    def __init__(self, speed: float) -> None:
        self._speed = speed
        self._left_m: float | None = None
        self._rested_s = 0.0
        self._ahead = np.array(AHEAD_AT_START)

    @property
    def has_begun(self) -> bool:
        """Whether the motion of the cuff has begun."""
        return self._left_m is not None

    @property
    def is_done(self) -> bool:
        """Whether the cuff's path has ended and the cuff has had time to arrive."""
        return self._rested_s >= SETTLING_S

    def target(self, arm: ArmPosition, cuff: Array, force_share: float, dt: float) -> HandTarget:
        """Returns the target of the robot's hand.

        Args:
            arm: Where the person's arm is.
            cuff: Where the middle of the cuff is (3) [m].
            force_share: Force on the arm as a share of its limit.
            dt: Time since the last target [s].
        """
        way = Way(arm)
        if self._left_m is None:
            self._left_m = way.length
        speed = self._speed * max(-1.0, 1.0 - force_share)
        if np.linalg.norm(way.place(way.length - self._left_m) - cuff) > MAX_LEAD_M:
            speed = min(speed, 0.0)
        self._left_m = min(max(self._left_m - speed * dt, 0.0), way.length)
        self._rested_s = 0.0 if self._left_m else self._rested_s + dt
        done = way.length - self._left_m
        self._ahead = _towards(self._ahead, way.ahead(done), MAX_TURN_RATE * dt)
        self._ahead /= np.linalg.norm(self._ahead)
        return holding(_towards(cuff, way.place(done), MAX_LEAD_M), self._ahead)


def _towards(start: Array, end: Array, largest: float) -> Array:
    """Returns the end if it is within the distance, otherwise a point on the way to it."""
    step = end - start
    return start + step * min(1.0, largest / max(float(np.linalg.norm(step)), 1e-12))
