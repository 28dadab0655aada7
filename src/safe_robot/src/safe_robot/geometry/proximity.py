"""Which things come too near to each other while a robot moves."""

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from safe_robot.motion import Motion
from safe_robot.pursuit import Bound

from .distances import Contact, LinkDistances, Pair

LEAST_SPACING_M = 0.01
"""The braking is tried no more densely than this [m], however small the margin is."""
ROUNDING_M = 1e-9
"""Distances that differ by less are equal [m]."""
KEPT_M = 1e-4
"""So much more than the margin is kept where a command is chosen, since distances are taken to be linear there [m]."""
STALE = 0.25
"""A distance is looked at anew when joints have moved so much of it."""
FAR_M = 0.5
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


def _onward(travelled: list[float], mark: int, to_m: float, last: int) -> int:
    """Returns the first mark beyond a way, or one before it where pairs often meet; above the last one: none is."""
    found = bisect_right(travelled, to_m)
    if found > last:
        return found
    for coarse in (8, 4, 2):
        if found // coarse * coarse > mark:
            return found // coarse * coarse
    return found


class Proximity:
    """Finds out which pairs come nearer than a margin, and nearer than they were.

    Distances are looked at anew only when joints have moved so far since that a pair might be too near. So most
    commands need few of them.

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
        """Returns the first pair that comes too near in a motion.

        From where a pair is so far apart, the braking is followed to where it might be too near, and so on.
        """
        if not len(self._pairs):
            return None
        margin_m, reach = self._margin_m, self._reach
        lost = (np.abs(motion.position[0] - self._known_at) * reach).sum(axis=1)
        room = self._known_m - lost - (margin_m + ROUNDING_M)
        near = np.flatnonzero(~(room > reach @ motion.path))
        if not len(near):
            return None
        room = np.where(lost[near] <= STALE * (self._known_m[near] - margin_m), room[near], -1.0)
        least = max(2.0 * margin_m, LEAST_SPACING_M)
        rows = self._sparse(motion.travelled @ reach[near].max(axis=0), least)
        travelled = (motion.travelled[rows] @ reach[near].T).T.tolist()  # of each pair, from the command on
        last = len(rows) - 1
        due = [_onward(one, -1, each, last) if each > 0.0 else 0 for one, each in zip(travelled, room.tolist())]
        while (mark := min(due)) <= last:
            self._distances.place(motion.position[rows[mark]])
            for k in [k for k, each in enumerate(due) if each == mark]:
                i = int(near[k])
                distance = self._distances.distance(self._pairs[i], FAR_M)
                if not distance >= margin_m and not self._is_further(motion, i, distance, rows[mark]):
                    return TooNear(self._pairs[i], distance, mark > 0)
                distance = min(distance, FAR_M)
                if mark == 0:
                    self._known_m[i], self._known_at[i] = distance, motion.position[0]
                room_m = distance - margin_m - ROUNDING_M
                to_m = travelled[k][mark] + room_m
                due[k] = mark + 1 if room_m <= least else max(_onward(travelled[k], mark, to_m, last), mark + 1)
        return None

    def _sparse(self, travelled: np.ndarray, spacing_m: float) -> list[int]:
        """Returns rows, the first and the last among them, between which nothing moves further than a spacing."""
        marks = np.arange(spacing_m, travelled[-1], spacing_m)
        rows = np.searchsorted(travelled, marks, side="right").tolist()
        return list(dict.fromkeys((0, *rows, len(travelled) - 1)))

    def _is_further(self, motion: Motion, i: int, distance: float, row: int) -> bool:
        """Returns whether a pair that is too near was no further apart before the motion."""
        self._distances.place(motion.start.position)
        before = self._distances.distance(self._pairs[i], FAR_M)
        self._distances.place(motion.position[row])
        return distance >= before - ROUNDING_M

    def bounds(self, end: np.ndarray, spread: np.ndarray, before: np.ndarray) -> list[Bound]:
        """Returns what keeps pairs apart near a configuration, see `Check.bounds`."""
        if not len(self._pairs):
            return []
        moved = np.abs(end - self._known_at) + spread
        nearest = self._known_m - (moved * self._reach).sum(axis=1)
        near = np.flatnonzero(~(nearest > self._margin_m + KEPT_M)).tolist()
        if near:
            self._distances.place(end)
        bounds = []
        for i in near:
            within_m = self._margin_m + KEPT_M + float(spread @ self._reach[i])
            contact = self._distances.contact(self._pairs[i], within_m)
            if contact is not None:
                gradient = self._distances.gradient(self._pairs[i], contact, end)
                room = contact.distance - self._margin_m - KEPT_M
                if room < 0.0:
                    self._distances.place(before)
                    room = max(room, contact.distance - self._distances.distance(self._pairs[i], FAR_M))
                    self._distances.place(end)
                bounds.append(Bound(gradient, room))
        return bounds

    def contacts(self, q: np.ndarray, within_m: float) -> Iterator[tuple[Pair, Contact]]:
        """Yields the pairs that are nearer than a distance in a configuration of n positions, and where they are."""
        self._distances.place(q)
        for pair in self._pairs:
            contact = self._distances.contact(pair, within_m)
            if contact is not None:
                yield pair, contact
