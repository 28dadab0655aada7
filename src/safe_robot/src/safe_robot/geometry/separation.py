"""Lower bounds of distances: how far a plane can be moved between two things."""

import math
from collections.abc import Sequence

import numpy as np

from .hulls import Solid

ROUNDING_M = 1e-4
"""PyBullet's distances may be that much too small [m]."""


class Separation:
    """Bounds the distances of p pairs from below, without measuring them.

    The distance of two convex things is at least their gap along any direction, and it is just that along the
    direction in which they were measured. So a direction is remembered for each pair, in the frame of the second thing.
    As long as none is, the bound is -inf.

    Args:
        pairs: The two things of each pair.
    """

    def __init__(self, pairs: Sequence[tuple[Solid, Solid]]) -> None:
        firsts, self._seconds = [first for first, _ in pairs], [second for _, second in pairs]
        size = max((len(solid.balls) for solid in firsts), default=1)
        self._balls = np.array([np.pad(each.balls, ((0, size - len(each.balls)), (0, 0)), "edge") for each in firsts])
        self._first_frame = np.array([each.frame for each in firsts], int)
        self._second_frame = np.array([each.frame for each in self._seconds], int)
        self._middle = np.array([each.middle for each in firsts]).reshape(-1, 3)
        self._direction = np.zeros((len(firsts), 3))
        self._edge = np.full(len(firsts), np.inf)  # how far the second thing goes along its direction
        for i, solid in enumerate(self._seconds):
            self.replace(i, solid)

    def replace(self, i: int, second: Solid) -> None:
        """Puts another thing into the place of the second one of a pair."""
        self._seconds[i] = second
        if second.normal is not None:
            self._turn(i, second.normal)
        elif self._direction[i].any():
            self._turn(i, self._direction[i])

    def learn(self, i: int, direction: Sequence[float], frames: np.ndarray) -> None:
        """Takes a direction for a pair: a line on which it is nearest, in the root, with its m frames, m x 4 x 4."""
        second = self._seconds[i]
        length = math.hypot(*direction)
        if second.normal is not None or not length > 0.0:
            return
        one, other = frames[self._first_frame[i]], frames[second.frame]
        apart = one[:3, :3] @ self._middle[i] + one[:3, 3] - other[:3, :3] @ second.middle - other[:3, 3]
        way = np.array(direction) / length
        self._turn(i, (way if way @ apart >= 0.0 else -way) @ other[:3, :3])

    def _turn(self, i: int, direction: np.ndarray) -> None:
        self._direction[i] = direction
        balls = self._seconds[i].balls
        self._edge[i] = (balls[:, :3] @ direction + balls[:, 3]).max()

    def lower_bounds(self, frames: np.ndarray, which: np.ndarray) -> np.ndarray:
        """Returns lower bounds of the distances of some pairs, in k configurations with m frames: k x len(which) [m].

        Args:
            frames: k x m x 4 x 4.
            which: Numbers of the pairs.
        """
        first, second = frames[:, self._first_frame[which]], frames[:, self._second_frame[which]]
        way = np.einsum("kpij,pj->kpi", second[..., :3, :3], self._direction[which])
        local = np.full((len(which), 4, len(frames)), -1.0)
        local[:, :3] = np.einsum("kpij,kpi->pjk", first[..., :3, :3], way)
        nearest = (self._balls[which] @ local).min(axis=1).T  # of the first thing, along its way, from its frame
        shift = first[..., :3, 3] - second[..., :3, 3]
        bounds: np.ndarray = nearest + np.einsum("kpi,kpi->kp", way, shift) - self._edge[which] - ROUNDING_M
        return bounds
