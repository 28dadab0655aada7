"""Search for pairs of shapes that come too near to each other while a robot moves."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from robot_model.collision.distances import Contact, LinkDistances, Pair
from robot_model.collision.separation import Separation
from safe_robot.motion import Bound, CommandedMotion

LEAST_SPACING_M = 0.01
"""Smallest motion of links between two rows that are checked first [m]; used for small margins."""
ROUNDING_M = 1e-9
"""Distances whose difference is smaller than this count as equal [m]."""
SPARE_M = 3e-4
"""Distance that the search for a safe command adds to the margin [m], since it uses linearised distances."""
LOOSE_M = 0.003
"""A lower bound that is at least this much below the measured distance is improved [m]."""
FAR_M = 10.0
"""Largest distance that is measured [m]."""


class TooNear(NamedTuple):
    """Two shapes that come too near to each other during a motion.

    Attributes:
        pair: Two links, or a link and an obstacle.
        distance: Distance between the shapes in the configuration in which the shapes are too near [m].
        is_while_braking: True if the shapes are too near during the braking, False if already at the command.
    """

    pair: Pair
    distance: float
    is_while_braking: bool


class Proximity:
    """Finds pairs of shapes whose distance falls below a margin and below the distance at the start of the motion.

    Most pairs are ruled out by a lower bound of their distance, which follows from the joints' motion or from a
    separating plane. Distances are measured only for the remaining pairs.

    Args:
        distances: Measures distances between shapes.
        pairs: The pairs to examine: two links, or a link and an obstacle.
        margin_m: Smallest allowed distance [m].
    """

    def __init__(self, distances: LinkDistances, pairs: Sequence[Pair], margin_m: float) -> None:
        self._distances, self._pairs, self._margin_m = distances, pairs, margin_m
        self._reach = np.array([distances.reach(pair) for pair in pairs])
        self._furthest = self._reach.max(axis=0, initial=0.0)
        self._separation = Separation([(distances.solids(a), distances.solids(b)) for a, b in pairs])
        self._last = -1, 0  # index of the last pair that was too near, and the row
        self._known_at = np.zeros((2, *self._reach.shape))  # configurations at both ends of a motion
        self._known_m = np.full((2, len(pairs)), -np.inf)  # lower bounds of the pairs' distances there

    def forget(self, indices: Sequence[int]) -> None:
        """Discards the stored bounds of the pairs with the given indices, whose obstacles have moved or changed."""
        self._known_m[:, list(indices)] = -np.inf
        for i in indices:
            self._separation.replace(i, self._distances.solids(self._pairs[i][1]))

    def first(self, motion: CommandedMotion) -> TooNear | None:
        """Returns a pair that comes too near in any row of a motion; None if all pairs keep their distance.

        Let d and e be a pair's distances in two rows, and m the length of the pair's relative motion from one row to
        the other. In all rows in between, the pair's distance is at least (d + e - m) / 2. If this bound is too
        small, every row in between is checked.
        """
        if not len(self._pairs):
            return None
        least_m, reach = self._margin_m + ROUNDING_M, self._reach
        known = self._known_near(motion.position[[0, -1], None])
        near = (~(known[0] + known[1] - reach @ motion.path > 2.0 * least_m)).nonzero()[0]
        if not len(near):
            return None
        i, row = self._last[0], min(self._last[1], len(motion.position) - 1)
        if motion.is_trial and i in near:
            self._distances.place(motion.position[row])
            if found := self._too_near(motion, i, row, self._contact(i)):
                return found
        rows = motion.waypoints
        bounds = self._separation.lower_bounds(motion.waypoint_frames, near)
        self._known_m[:, near], self._known_at[:, near] = bounds[[0, -1]], motion.position[[0, -1], None]
        steps = np.diff(motion.travelled[rows], axis=0) @ reach[near].T
        between = (bounds[:-1] + bounds[1:] - steps) / 2.0 if len(rows) > 1 else bounds  # bounds between two waypoints
        is_unsure = ~(between > least_m)  # also for NaN
        suspects = np.flatnonzero(is_unsure.any(axis=0))
        if not len(suspects):
            return None
        all_rows = np.arange(len(motion.position))
        section = np.clip(np.searchsorted(rows, all_rows, side="right") - 1, 0, len(is_unsure) - 1)
        return self._first_in_rows(motion, near[suspects], all_rows[is_unsure.any(axis=1)[section]])

    def _first_in_rows(self, motion: CommandedMotion, suspects: np.ndarray, rows: np.ndarray) -> TooNear | None:
        """Returns one of s pairs that comes too near in one of k rows; None if no pair does.

        Measures distances in a few rows first. These rows usually reveal an unsafe motion, and give lower bounds for
        most of the other rows.

        Args:
            motion: The motion.
            suspects: Indices of the s pairs.
            rows: Indices of the k rows of the motion.
        """
        moved = motion.travelled[rows] @ self._reach[suspects].T
        spare = np.full(moved.shape, -np.inf)
        sparse = self._sparse(motion.travelled[rows] @ self._furthest)
        if found := self._first_measured(motion, suspects, rows, sparse, moved, spare):
            return found
        _spread_bounds(spare, sparse, moved)
        unsure = np.flatnonzero(~(spare > 0.0).all(axis=1))
        return self._first_measured(motion, suspects, rows, unsure, moved, spare) if len(unsure) else None

    def _first_measured(
        self,
        motion: CommandedMotion,
        suspects: np.ndarray,
        rows: np.ndarray,
        chosen: np.ndarray,
        moved: np.ndarray,
        spare: np.ndarray,
    ) -> TooNear | None:
        """Returns one of s pairs that comes too near in the chosen rows; measures distances only where necessary.

        If `motion.is_trial`, the pair and row with the smallest bound are measured next, since the pair is most likely
        too near there. Otherwise rows are measured in order, so that equal motions have equal answers.

        Args:
            motion: The motion.
            suspects: Indices of the s pairs.
            rows: Indices of the k rows of the motion.
            chosen: Indices into `rows` of the rows to examine.
            moved: Upper bound of the length of each pair's relative motion from row 0 to each row, shape (k, s) [m].
            spare: Lower bounds of distance minus margin, shape (k, s) [m]; updated in place. The value inf marks a
                pair that has already been measured in a row.
        """
        least_m = self._margin_m + ROUNDING_M
        frames = self._distances.frames(motion.position[rows[chosen]])
        spare[chosen] = np.fmax(spare[chosen], self._separation.lower_bounds(frames, suspects) - least_m)
        placed = -1
        while (bounds := spare[chosen]).min() <= 0.0:
            at, k = divmod(int(bounds.argmin() if motion.is_trial else (bounds <= 0.0).argmax()), len(suspects))
            i, row = int(suspects[k]), int(rows[chosen[at]])
            if placed != row:
                self._distances.place(motion.position[row])
                placed = row
            contact = self._contact(i)
            if found := self._too_near(motion, i, row, contact):
                return found
            distance = FAR_M if contact is None else contact.distance
            if contact is not None and not distance - least_m < bounds[at, k] + LOOSE_M:
                self._separation.learn(i, contact.directions, frames[at])
                more = self._separation.lower_bounds(frames, suspects[k : k + 1])[:, 0] - least_m
                spare[chosen, k] = np.fmax(spare[chosen, k], more)
            spare[:, k] = np.maximum(spare[:, k], distance - least_m - np.abs(moved[:, k] - moved[chosen[at], k]))
            spare[chosen[at], k] = np.inf
        return None

    def _known_near(self, q: np.ndarray) -> np.ndarray:
        """Returns lower bounds of all pairs' distances [m], shape (..., 2, pairs).

        Lower bounds are stored for two configurations: the first and the last row of an earlier motion. Each returned
        bound is a stored bound minus the largest possible change of distance between the stored configuration and `q`.

        Args:
            q: Joint positions to compare with each stored configuration, shape (..., 2, 1, n); or (..., 1, 1, n) to
                compare the same positions with both.
        """
        known: np.ndarray = self._known_m - np.einsum("...n,...n->...", np.abs(q - self._known_at), self._reach)
        return known

    def _sparse(self, travelled: np.ndarray) -> np.ndarray:
        """Returns the indices of a few rows, including the first and the last of k rows.

        The path between successive returned rows is about twice the margin, or `LEAST_SPACING_M` if this is longer.

        Args:
            travelled: Path length up to each of the k rows, shape (k,) [m].
        """
        spacing_m = max(2.0 * self._margin_m, LEAST_SPACING_M)
        marks = np.arange(travelled[0] + spacing_m, travelled[-1], spacing_m)
        between = np.searchsorted(travelled, marks, side="right").tolist()
        return np.array(list(dict.fromkeys((0, *between, len(travelled) - 1))))

    def _contact(self, i: int) -> Contact | None:
        return self._distances.contact(self._pairs[i], FAR_M, self._margin_m + ROUNDING_M)

    def _too_near(self, motion: CommandedMotion, i: int, row: int, contact: Contact | None) -> TooNear | None:
        """Returns pair `i` if the pair's distance is below the margin and below its distance at the start; else None.

        The caller has moved the robot to the configuration of the row, and has measured `contact` there.
        """
        if contact is None or contact.distance >= self._margin_m:
            return None
        self._distances.place(motion.start.position)
        before = self._distances.distance(self._pairs[i], FAR_M, self._margin_m)
        if contact.distance >= before - ROUNDING_M:
            self._distances.place(motion.position[row])
            return None
        self._last = i, row
        return TooNear(self._pairs[i], contact.distance, row > 0)

    def bounds(self, rows: np.ndarray, spread: np.ndarray, before: np.ndarray) -> list[Bound]:
        """Returns linear bounds on positions that keep the pairs apart; see `Check.bounds`."""
        if not len(self._pairs):
            return []
        within_m = self._margin_m + SPARE_M + self._reach @ spread
        near = np.flatnonzero(~(self._known_near(rows[:, None, None]).max(axis=1) > within_m).all(axis=0))
        if not len(near):
            return []
        frames = self._distances.frames(rows)
        least = self._separation.lower_bounds(frames, near)
        bounds, placed = [], -1
        for row, k in np.argwhere(~(least > within_m[near])).tolist():
            i = int(near[k])
            pair = self._pairs[i]
            if placed != row:
                self._distances.place(rows[row])
                placed = row
            contact = self._distances.contact(pair, FAR_M, float(within_m[i]))
            if contact is None:
                continue
            if not contact.distance < least[row, k] + LOOSE_M:
                self._separation.learn(i, contact.directions, frames[row])
            if contact.distance >= within_m[i]:
                continue
            gradient = self._distances.gradient(pair, contact, rows[row])
            room = contact.distance - self._margin_m - SPARE_M
            if room < 0.0:
                self._distances.place(before)
                room = max(room, contact.distance - self._distances.distance(pair, FAR_M, float(within_m[i])))
                placed = -1
            bounds.append(Bound(row, gradient, room))
        return bounds

    def contacts(self, q: np.ndarray, within_m: float) -> Iterator[tuple[Pair, Contact]]:
        """Yields each pair whose distance at n joint positions is less than `within_m` [m], and its closest points."""
        self._distances.place(q)
        for pair in self._pairs:
            contact = self._distances.contact(pair, within_m, within_m)
            if contact is not None and contact.distance < within_m:
                yield pair, contact


def _spread_bounds(bounds: np.ndarray, rows: np.ndarray, moved: np.ndarray) -> None:
    """Improves the lower bounds of distances in k rows, in place, using the bounds in some of these rows.

    Between two rows, the distance of a pair changes at most by the length of the pair's relative motion.

    Args:
        bounds: Lower bounds for s pairs, shape (k, s) [m]. Values of inf are not used for other rows.
        rows: Indices of the rows whose bounds are used, in ascending order.
        moved: Upper bound of the length of each pair's relative motion from row 0 to each row, shape (k, s) [m].
    """
    known = np.where(bounds[rows] < np.inf, bounds[rows], -np.inf)
    after = np.clip(np.searchsorted(rows, np.arange(len(bounds))), 0, len(rows) - 1)
    for side in (after, np.maximum(after - 1, 0)):
        np.maximum(bounds, known[side] - np.abs(moved[rows[side]] - moved), out=bounds)
