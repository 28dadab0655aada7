"""Shortening of paths by proven shortcuts."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from .collision import CollisionModel
from .planner import length

Array = np.ndarray
MIN_GAIN = 1e-3
"""Least share of its length by which a shortcut has to be shorter."""
PATIENCE = 60
"""Number of shortcuts without success after which shortening ends."""


def shortened(
    path: Array,
    model: CollisionModel,
    until: float,
    seed: int,
    is_cancelled: Callable[[], bool] = lambda: False,
    connect: Callable[[Array, Array], Array | None] | None = None,
) -> Array:
    """Shortens a path whose straight parts are proven; those of the result are proven, too.

    First, waypoints are left out. Then, random points of the path are connected, and corners are cut, until the time is
    up or no shortcut is found any more (Geraerts and Overmars, 2007, Creating high-quality paths for motion planning).

    Args:
        path: Waypoints, m x n [rad or m].
        model: Proves motions.
        until: Time of `time.monotonic` at which the search ends [s].
        seed: Seed of random numbers.
        is_cancelled: Function that says whether the search has to end.
        connect: Function that returns proven waypoints between two configurations, both included, or None. By default,
            the straight motion is tried.
    """
    generator = np.random.default_rng(seed)

    def is_over() -> bool:
        return time.monotonic() >= until or is_cancelled()

    path, failed = _without_detours(path, model, is_over), 0
    while len(path) > 2 and failed < PATIENCE and not is_over():
        lengths = np.concatenate(((0.0,), np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))))
        if generator.random() < 0.5:
            a, b = np.sort(generator.uniform(0.0, lengths[-1], 2))
        else:  # around a corner
            corner = lengths[generator.integers(1, len(path) - 1)]
            size = generator.uniform(0.02, 0.5) * lengths[-1]
            a, b = max(0.0, corner - size * generator.random()), min(lengths[-1], corner + size * generator.random())
        i, j = (int(np.clip(np.searchsorted(lengths, each, "right") - 1, 0, len(path) - 2)) for each in (a, b))
        failed += 1
        if i == j:
            continue
        first, last = (
            path[k] + (path[k + 1] - path[k]) * ((s - lengths[k]) / max(lengths[k + 1] - lengths[k], 1e-12))
            for k, s in ((i, a), (j, b))
        )
        least = (b - a) * (1.0 - MIN_GAIN)
        if np.linalg.norm(last - first) > least:
            continue
        if model.edge(first, last):
            between: Array | None = np.array((first, last))
        else:
            between = None if connect is None else connect(first, last)
        if between is not None and length(between) < least:
            path, failed = _without_repeats(np.concatenate((path[: i + 1], between, path[j + 1 :]))), 0
    return _without_detours(path, model, is_over)


def _without_detours(path: Array, model: CollisionModel, is_over: Callable[[], bool]) -> Array:
    """Leaves out waypoints whose neighbours have a free motion between them, from the farthest neighbours on."""
    kept, at = [path[0]], 0
    while at < len(path) - 1:
        ahead = len(path) - 1
        while ahead > at + 1 and (is_over() or not model.edge(path[at], path[ahead])):
            ahead = at + 1 if is_over() else ahead - max(1, (ahead - at) // 4)
            ahead = max(ahead, at + 1)
        kept.append(path[ahead])
        at = ahead
    shorter = np.array(kept)
    return shorter if length(shorter) <= length(path) + 1e-9 else path


def _without_repeats(path: Array) -> Array:
    steps = np.abs(np.diff(path, axis=0)).max(axis=1)
    return (
        path[np.concatenate(((True,), steps > 1e-9))]
        if steps[-1] > 1e-9
        else np.concatenate((path[:-1][np.concatenate(((True,), steps[:-1] > 1e-9))][:-1], path[-1:]))
    )
