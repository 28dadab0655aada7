"""Paths of a robot of two joints over a grid of configurations that keep a distance."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from .oracle import Oracle

STEP = 0.02
"""Distance between two points of the grid [rad]."""
BEYOND_M = 0.002
"""A path ends where all distances exceed the required one by this value [m]."""


class Grid:
    """Distances on a grid of two joints."""

    def __init__(self, oracle: Oracle) -> None:
        self._oracle = oracle
        self._places = [np.arange(low, high, STEP) for low, high in zip(oracle.lower, oracle.upper)]

    @cached_property
    def _nearest_m(self) -> np.ndarray:
        """The smallest distance at each point [m]."""
        turns, elbows = self._places
        return np.array([[self._oracle.distances((turn, elbow)).min() for elbow in elbows] for turn in turns])

    def way_out(self, start: np.ndarray, keep_m: float, end_m: float) -> list[np.ndarray] | None:
        """Returns the shortest path over points that keep one distance to a point that keeps another [m], or None.

        It begins at the point that is nearest to the start.
        """
        is_free = self._nearest_m >= keep_m
        rows = np.stack(np.meshgrid(*self._places, indexing="ij"), axis=-1)[is_free]
        numbers = np.full(is_free.shape, -1)
        numbers[is_free] = np.arange(len(rows))
        begins, ends, lengths = [], [], []
        for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
            a = numbers[: len(numbers) - down, max(0, -right) : numbers.shape[1] - max(0, right)]
            b = numbers[down:, max(0, right) : numbers.shape[1] - max(0, -right)]
            both = (a >= 0) & (b >= 0)
            begins.append(a[both])
            ends.append(b[both])
            lengths.append(np.full(both.sum(), np.hypot(down, right)))
        graph = coo_matrix((np.concatenate(lengths), (np.concatenate(begins), np.concatenate(ends))), (len(rows),) * 2)
        first = int(np.argmin(np.linalg.norm(rows - start, axis=1)))
        far, before = dijkstra(graph, directed=False, indices=first, return_predecessors=True)
        far[self._nearest_m[is_free] < end_m + BEYOND_M] = np.inf
        at = int(np.argmin(far))
        if not np.isfinite(far[at]):
            return None
        way = [rows[at]]
        while at != first:
            at = int(before[at])
            way.append(rows[at])
        return way[::-1]
