"""Proofs that whole motions are free.

Between two configurations, the distance of a pair of shapes changes at most by the pair's reach times the motion of the
joints, see `RobotModel.reach`. If the distances at both ends together exceed this change, the pair is free in between.
Otherwise, the interval is divided (Schwarzer, Saha and Latombe, 2005, Adaptive dynamic collision checking).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from .group import Array

SMALLEST_STEP = 1e-5
"""Motion of a joint [rad or m] below which an interval is no longer divided: it counts as not free."""
FAR_M = 0.15
"""Change of a distance [m] above which an interval is divided before distances are measured exactly."""
MAX_ROWS = 200_000
"""Largest number of pairs and intervals of one proof; a motion that needs more counts as not free."""


class CheckedPairs(Protocol):
    """Pairs of shapes whose distances can be computed, and further margins.

    Attributes:
        first: Number of the first shape of each pair.
        padding: Least allowed distance of each pair [m].
        margins: Further margins.
        all_reach: n upper bounds on the change of each distance and margin per rad or m of each joint.
    """

    first: Array
    padding: Array
    margins: list[Any]
    all_reach: Array

    def distances(self, q: Array, pairs: Sequence[int] | None = None) -> Array:
        """Returns the distances of pairs of shapes in one configuration [m]."""

    def bounds(self, q: Array, which: Array) -> Array:
        """Returns lower bounds on distances in k configurations, less the padding, k x len(which) [m]."""


class JointMotion(Protocol):
    """A motion of n joints from time 0 to `duration`."""

    @property
    def duration(self) -> float:
        """Duration of the motion."""

    def at(self, times: Array) -> Array:
        """Returns the positions at k times, k x n [rad or m]."""

    def variation(self, start: Array, end: Array) -> Array:
        """Returns upper bounds on the joint motion (total variation) between k pairs of times, k x n [rad or m]."""


class StraightMotion:
    """The straight motion from one configuration to another, from time 0 to 1."""

    @property
    def duration(self) -> float:
        """See `JointMotion`."""
        return 1.0

    def __init__(self, start: Array, end: Array) -> None:
        self._start, self._change = start, end - start

    def at(self, times: Array) -> Array:
        """See `JointMotion`."""
        q: Array = self._start + times[:, None] * self._change
        return q

    def variation(self, start: Array, end: Array) -> Array:
        """See `JointMotion`."""
        motion: Array = (end - start)[:, None] * np.abs(self._change)
        return motion


def first_unproven(model: CheckedPairs, motion: JointMotion) -> float | None:
    """Returns a time at which a motion is not proven to be free; None for a motion that is free."""
    pairs = len(model.first)
    times, which = np.array((0.0, motion.duration)), np.arange(pairs + len(model.margins))
    q = motion.at(times)
    known: dict[float, Array] = {}
    gaps = model.bounds(q, which)
    t0, t1 = (np.full(len(which), time) for time in times)
    g0, g1 = gaps
    exact0, exact1 = which >= pairs, which >= pairs
    while len(which):
        step = motion.variation(t0, t1)
        change = (step * model.all_reach[which]).sum(axis=1)
        waits = g0 + g1 <= change
        if not waits.any():
            return None
        t0, t1, g0, g1, which, change, step, exact0, exact1 = (
            each[waits] for each in (t0, t1, g0, g1, which, change, step, exact0, exact1)
        )
        if (bad := (g0 < 0.0) & exact0).any():
            return float(t0[bad].min())
        if (bad := (g1 < 0.0) & exact1).any():
            return float(t1[bad].min())
        measured = (exact0 & exact1) | (change > FAR_M)
        if not measured.all():  # exact distances where bounds did not suffice
            for at, gap, exact in ((t0, g0, exact0), (t1, g1, exact1)):
                asked = ~exact & ~measured
                for time in np.unique(at[asked]).tolist():
                    rows = np.flatnonzero((at == time) & asked)
                    gap[rows] = _exact(model, known, motion, time, which[rows])
                    if (gap[rows] < 0.0).any():
                        return time
                exact |= asked
            continue
        if (step.max(axis=1) < SMALLEST_STEP).any() or len(which) > MAX_ROWS:
            return float(t0[int(np.argmin(step.max(axis=1)))])
        middle = (t0 + t1) / 2.0
        unique, back = np.unique(middle, return_inverse=True)
        asked = np.unique(which)
        bounds = model.bounds(motion.at(unique), asked)[back, np.searchsorted(asked, which)]
        is_margin = which >= pairs
        t0, t1 = np.concatenate((t0, middle)), np.concatenate((middle, t1))
        g0, g1 = np.concatenate((g0, bounds)), np.concatenate((bounds, g1))
        exact0, exact1 = np.concatenate((exact0, is_margin)), np.concatenate((is_margin, exact1))
        which = np.concatenate((which, which))
    return None


def _exact(model: CheckedPairs, known: dict[float, Array], motion: JointMotion, time: float, which: Array) -> Array:
    """Returns exact distances of pairs at one time of a motion, less the padding [m]."""
    if time not in known:
        known[time] = np.full(len(model.first), np.nan)
    gaps = known[time]
    missing = which[np.isnan(gaps[which])]
    if len(missing):
        gaps[missing] = model.distances(motion.at(np.array((time,)))[0], missing.tolist()) - model.padding[missing]
    values: Array = gaps[which]
    return values
