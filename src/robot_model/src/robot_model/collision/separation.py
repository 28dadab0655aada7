"""Lower bounds on distances, computed as gaps between parallel planes that separate shapes."""

from collections.abc import Sequence

import numpy as np

from .solids import Solid

ROUNDING_M = 1e-4
"""Largest amount by which distances from PyBullet are too small [m]."""


class Separation:
    """Computes lower bounds on the distances of p pairs without measuring the distances.

    A pair is two links, or a link and an obstacle. The distance between two convex shapes is at least the gap between
    them along any direction. Along the line between the closest points, the gap equals the distance. `learn` stores
    such a direction for each combination of a shape of the first member and a shape of the second member, in the frame
    of the second shape. Before a direction is stored, the bound is -inf.

    Args:
        pairs: Shapes of the first member and shapes of the second member of each pair.
    """

    def __init__(self, pairs: Sequence[tuple[Sequence[Solid], Sequence[Solid]]]) -> None:
        both = [(first, second) for firsts, seconds in pairs for first in firsts for second in seconds]
        counts = [len(firsts) * len(seconds) for firsts, seconds in pairs]
        self._counts = np.array(counts, int)
        ends = np.cumsum(self._counts)
        self._rows = [np.arange(end - count, end) for end, count in zip(ends.tolist(), counts)]
        self._pair = np.repeat(np.arange(len(pairs)), counts)
        self._first, self._second = (_balls([each[side] for each in both]) for side in (0, 1))
        frames = np.array([(first.frame, second.frame) for first, second in both], int).reshape(-1, 2)
        self._first_frame, self._second_frame = frames.T.copy()
        self._direction = np.zeros((len(both), 3))
        self._edge = np.full(len(both), np.inf)  # extent of the second shape along its direction
        for i, (_, seconds) in enumerate(pairs):
            self.replace(i, seconds)

    def replace(self, i: int, seconds: Sequence[Solid]) -> None:
        """Replaces the shapes of the second member of pair `i`; the number of shapes must not change."""
        rows = self._rows[i]
        for row, solid in zip(rows.tolist(), list(seconds) * (len(rows) // len(seconds))):
            more = len(solid.balls) - self._second.shape[1]
            if more > 0:
                self._second = np.pad(self._second, ((0, 0), (0, more), (0, 0)), "edge")
            self._second[row] = _balls([solid], self._second.shape[1])[0]
            if solid.normal is not None:
                self._direction[row] = solid.normal
            if self._direction[row].any():
                self._edge[row] = (self._second[row] @ (*self._direction[row], 1.0)).max()

    def learn(self, i: int, directions: Sequence[Sequence[float]], frames: np.ndarray) -> None:
        """Chooses and stores, for each combination of shapes of a pair, the direction with the largest gap.

        Args:
            i: Index of the pair.
            directions: Candidate directions in the root frame, along lines between closest points, with any sign.
            frames: Poses of the m frames of `LinkFrames` in the root frame, m x 4 x 4.
        """
        rows = self._rows[i]
        first, second = frames[self._first_frame[rows[0]]], frames[self._second_frame[rows[0]]]
        units = np.array(directions)
        units /= np.sqrt((units * units).sum(axis=1))[:, None]
        at_first, at_second = units @ first[:3, :3], units @ second[:3, :3]
        low, high = _extent(self._first[rows], at_first)
        low_other, high_other = _extent(self._second[rows], at_second)
        shift = units @ (first[:3, 3] - second[:3, 3])
        gaps = np.concatenate((low + shift - high_other, low_other - shift - high), axis=1)
        best = np.where(np.isnan(gaps), -np.inf, gaps).argmax(axis=1)
        self._direction[rows] = np.concatenate((at_second, -at_second))[best]
        self._edge[rows] = np.concatenate((high_other, -low_other), axis=1)[np.arange(len(rows)), best]

    def lower_bounds(self, frames: np.ndarray, which: np.ndarray) -> np.ndarray:
        """Returns lower bounds on the distances of selected pairs in k configurations, k x len(which) [m].

        Args:
            frames: Poses of the m frames in the root frame in each configuration, k x m x 4 x 4.
            which: Ascending indices of the selected pairs; at least one.
        """
        is_asked = np.zeros(len(self._counts), bool)
        is_asked[which] = True
        rows = np.flatnonzero(is_asked[self._pair])
        first, second = frames.take(self._first_frame[rows], axis=1), frames.take(self._second_frame[rows], axis=1)
        direction = np.einsum("kpij,pj->kpi", second[..., :3, :3], self._direction[rows])
        local = np.full((len(rows), len(frames), 4), -1.0)
        local[..., :3] = np.einsum("kpij,kpi->pkj", first[..., :3, :3], direction)
        nearest = (local @ self._first[rows].transpose(0, 2, 1)).min(axis=2).T  # least coordinate of the first shape
        shift = np.einsum("kpi,kpi->kp", direction, first[..., :3, 3] - second[..., :3, 3])
        gaps = nearest + shift - (self._edge[rows] + ROUNDING_M)
        starts = np.cumsum(self._counts[which]) - self._counts[which]
        bounds: np.ndarray = np.minimum.reduceat(gaps, starts, axis=1)
        return bounds


def _balls(solids: Sequence[Solid], size: int = 1) -> np.ndarray:
    """Stacks the balls of p solids in an array p x v x 4. For solids with fewer than v balls, repeats the last ball."""
    size = max([size, *(len(solid.balls) for solid in solids)])
    balls = [np.pad(solid.balls, ((0, size - len(solid.balls)), (0, 0)), "edge") for solid in solids]
    return np.array(balls).reshape(-1, size, 4)


def _extent(balls: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns the smallest and the largest coordinate of p groups of v balls along d unit vectors, both p x d."""
    along, radius = balls[:, :, :3] @ directions.T, balls[:, :, 3:]
    return (along - radius).min(axis=1), (along + radius).max(axis=1)
