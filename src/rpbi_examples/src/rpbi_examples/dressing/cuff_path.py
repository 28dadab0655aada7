"""The path along which a robot pulls the cuff of a sleeve over a person's arm."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CUFF = (0.86, -0.26, 1.43)
"""Initial position of the middle of the cuff [m], as in `sleeve.yaml`."""
AHEAD_AT_START = (-1.0, 0.0, 0.0)
"""Unit vector of the initial direction in which the cuff is pulled."""
HAND_M, BEFORE_HAND_M = 0.19, 0.05
"""Length of a hand, and distance before the fingertips at which the cuff is in line with the forearm [m]."""
PAST_ELBOW_M = 0.10
"""Distance past the elbow at which the path of the cuff ends [m]."""
BLEND_M = 0.05
"""Distance before and after the elbow over which the cuff turns [m]."""
HELD_OUT_M = 0.25
"""Largest distance between the cuff's initial position and the point before the hand of an arm that is held out [m]."""


class ArmPosition(NamedTuple):
    """Positions of shoulder, elbow and wrist of a person's arm in the world, each of shape (3,) [m]."""

    shoulder: Array
    elbow: Array
    wrist: Array


class CuffPath:
    """Path of the middle of the cuff. The path leads from the cuff's initial position to a point in front of the
    fingertips, then over hand and forearm, and ends past the elbow.

    Args:
        arm: Positions of shoulder, elbow and wrist of the person's arm.

    Attributes:
        length: Length of the path [m].
    """

    def __init__(self, arm: ArmPosition) -> None:
        forearm = _unit(arm.wrist - arm.elbow)
        before = arm.wrist + (HAND_M + BEFORE_HAND_M) * forearm
        end = arm.elbow + PAST_ELBOW_M * _unit(arm.shoulder - arm.elbow)
        self._corners = [np.array(CUFF), before, arm.wrist, arm.elbow, end]
        self.length = sum(math.dist(a, b) for a, b in pairwise(self._corners))

    def place(self, done: float) -> Array:
        """Returns the point at the distance `done` along the path [m], shape (3,) [m]."""
        return _along(self._corners, done)

    def ahead(self, done: float) -> Array:
        """Returns the direction in which the cuff is pulled at the distance `done` along the path [m].

        Returns:
            Unit vector, shape (3,). In front of the fingertips, this is the direction from the wrist to the elbow.
        """
        start = math.dist(*self._corners[:2])
        to = self.place(min(max(done, start) + BLEND_M, self.length))
        return _unit(to - self.place(max(done - BLEND_M, start)))


def is_held_out(arm: ArmPosition) -> bool:
    """Returns whether an arm is held out towards the cuff's initial position; see `HELD_OUT_M`."""
    forearm = _unit(arm.wrist - arm.elbow)
    return math.dist(arm.wrist + (HAND_M + BEFORE_HAND_M) * forearm, CUFF) < HELD_OUT_M


def _unit(vector: Array) -> Array:
    return vector / np.linalg.norm(vector)


def _along(corners: Sequence[Array], distance: float) -> Array:
    """Returns the point at a given distance along a polyline [m], or the last corner if the polyline is shorter."""
    for a, b in pairwise(corners):
        length = math.dist(a, b)
        if distance <= length:
            return a + (b - a) * (distance / max(length, 1e-12))
        distance -= length
    return corners[-1]
