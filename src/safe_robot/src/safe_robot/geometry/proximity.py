"""Which things come too near to each other while a robot moves."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from safe_robot.motion import Motion

from .distances import Contact, LinkDistances, Pair

LEAST_SPACING_M = 0.01
"""The braking is tried no more densely than this [m], however small the margin is."""
ROUNDING_M = 1e-9
"""Distances that differ by less are equal [m]."""
FAR_M = 0.3
"""Distances are not looked at beyond this [m]."""


class TooNear(NamedTuple):
    """A pair that comes too near.

    Attributes:
        pair: Which one.
        distance: How near [m].
        is_while_braking: Whether not the command does it, but the braking.
    """

    pair: Pair
    distance: float
    is_while_braking: bool


class Proximity:
    """Finds out which pairs come nearer than a margin, and nearer than they were.

    Distances are looked at anew only when joints have moved so far since that a pair might be too near. So most
    commands need few of them, and the answers are the same.

    Args:
        distances: Where shapes are.
        pairs: The pairs.
        margin_m: The margin [m].
    """

    def __init__(self, distances: LinkDistances, pairs: Sequence[Pair], margin_m: float) -> None:
        self._distances, self._pairs, self._margin_m = distances, pairs, margin_m
        self._reach = np.array([distances.reach(pair) for pair in pairs])
        self._known_at = np.zeros_like(self._reach)  # where each pair's distance was looked at last
        self._known_m = np.full(len(pairs), -np.inf)

    def forget(self, indices: Sequence[int]) -> None:
        """Looks at some pairs anew, since what moved are not the joints."""
        self._known_m[list(indices)] = -np.inf

    def first(self, motion: Motion) -> TooNear | None:
        """Returns the first pair that comes too near in a motion."""
        if not len(self._pairs):
            return None
        near = self._near(motion)
        if len(near):
            self._look_at(motion.position[0], near)
            near = self._near(motion)
        return self._nearer(motion, near) if len(near) else None

    def contacts(self, q: np.ndarray, within_m: float) -> list[tuple[Pair, Contact]]:
        """Returns where pairs are nearest that are within a distance, in a configuration of n positions."""
        if not len(self._pairs):
            return []
        nearest = self._known_m - (np.abs(q - self._known_at) * self._reach).sum(axis=1)
        near = np.flatnonzero(~(nearest > within_m)).tolist()
        if near:
            self._distances.place(q)
        found = ((self._pairs[i], self._distances.contact(self._pairs[i], within_m)) for i in near)
        return [(pair, contact) for pair, contact in found if contact is not None]

    def _look_at(self, q: np.ndarray, indices: np.ndarray) -> None:
        self._distances.place(q)
        self._known_m[indices] = [min(self._distances.distance(self._pairs[i], FAR_M), FAR_M) for i in indices.tolist()]
        self._known_at[indices] = q

    def _near(self, motion: Motion) -> np.ndarray:
        """Returns which pairs might come too near, by how far they were apart somewhere and how far they move."""
        moved = np.abs(motion.position[0] - self._known_at) + motion.path  # pairs x n
        nearest = self._known_m - (moved * self._reach).sum(axis=1)
        return np.flatnonzero(~(nearest > self._margin_m + ROUNDING_M))

    def _nearer(self, motion: Motion, near: np.ndarray) -> TooNear | None:
        margin_m = self._margin_m
        reach = self._reach[near].max(axis=0)
        indices = near.tolist()
        for row in motion.sparse_rows(reach, max(2.0 * margin_m, LEAST_SPACING_M)).tolist():
            self._distances.place(motion.with_start[row])
            found = [(i, self._distances.distance(self._pairs[i], margin_m)) for i in indices]
            for i, distance in found:
                if not distance >= margin_m and not distance >= self._at(motion.start.position, i) - ROUNDING_M:
                    return TooNear(self._pairs[i], distance, row > 1)
        return None

    def _at(self, q: np.ndarray, i: int) -> float:
        self._distances.place(q)
        return self._distances.distance(self._pairs[i], self._margin_m)
