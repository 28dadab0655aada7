"""Joint limits, and start positions of a search within the limits."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator, Sequence
from typing import Protocol

import numpy as np

MAX_MAGNITUDE = 1e9
"""Largest accepted position, velocity or effort, in any unit. Squares of larger numbers may overflow."""
LIMIT_ROUNDING = 1e-6
"""Distance beyond a limit up to which a position still counts as within the limits [rad or m]."""
TURN = 2.0 * math.pi
Generator = random.Random | np.random.Generator


class Axis(Protocol):
    """A revolute or prismatic joint with limits [rad or m]."""

    @property
    def lower(self) -> float: ...

    @property
    def upper(self) -> float: ...

    @property
    def is_revolute(self) -> bool: ...


class Limits:
    """Limits of n joints, stored as plain numbers, since calculations with small arrays are slower.

    Args:
        lower: n lower limits [rad or m]; -inf for joints without a lower limit.
        upper: n upper limits [rad or m]; inf for joints without an upper limit.
        is_revolute: n flags, true for revolute and continuous joints.

    Attributes:
        middle: n positions half-way between the limits. For a joint that lacks a limit, the allowed position that is
            nearest to 0.
    """

    def __init__(self, lower: Sequence[float], upper: Sequence[float], is_revolute: Sequence[bool]) -> None:
        self.lower, self.upper, self.is_revolute = tuple(lower), tuple(upper), tuple(is_revolute)
        self._joints = tuple(zip(self.lower, self.upper, self.is_revolute))
        self.middle = tuple(
            (low + high) / 2.0 if math.isfinite(high - low) else min(max(0.0, low), high)
            for low, high in zip(lower, upper)
        )

    @classmethod
    def of_joints(cls, joints: Sequence[Axis]) -> Limits:
        """Collects the limits of several joints, in the order of `joints`."""
        lower, upper = [joint.lower for joint in joints], [joint.upper for joint in joints]
        return cls(lower, upper, [joint.is_revolute for joint in joints])

    def of(self, members: Sequence[int]) -> Limits:
        """Returns the limits of a subset of the joints, selected by their indices."""
        lower, upper = [self.lower[i] for i in members], [self.upper[i] for i in members]
        return Limits(lower, upper, [self.is_revolute[i] for i in members])

    def wrap_to_limits(self, q: Sequence[float], near: Sequence[float]) -> tuple[list[float], list[bool]]:
        """Moves positions into the limits: by whole turns if this is possible for a revolute joint, or by clipping.

        A position that exceeds a limit by at most `LIMIT_ROUNDING` is set to the limit, and does not count as clipped.

        Args:
            q: n positions [rad or m].
            near: n reference positions [rad or m]. If several equivalent angles of a revolute joint are within the
                limits, the angle nearest to its reference position is preferred.

        Returns:
            The n positions within the limits, and n flags that tell which positions were clipped.
        """
        inside, stopped = [], []
        for position, close, (lower, upper, is_revolute) in zip(q, near, self._joints):
            if is_revolute:
                position -= TURN * round((position - close) / TURN)
            fits = lower <= position <= upper
            if not fits:
                turned = _turned(position, lower, upper) if is_revolute else position
                fits = lower - LIMIT_ROUNDING <= turned <= upper + LIMIT_ROUNDING
                position = min(max(turned if fits else position, lower), upper)
            inside.append(position)
            stopped.append(not fits)
        return inside, stopped

    def clip(self, q: Sequence[float]) -> list[float]:
        """Returns positions clipped to the limits [rad or m]."""
        return [min(max(position, lower), upper) for position, lower, upper in zip(q, self.lower, self.upper)]

    def random(self, generator: Generator, near: Sequence[float]) -> list[float]:
        """Draws uniformly distributed random positions within the limits.

        If a joint lacks a limit, its range ends half a turn or 1 m from the joint's position in `near`.
        """
        positions = []
        for close, (lower, upper, is_revolute) in zip(near, self._joints):
            half = math.pi if is_revolute else 1.0
            low = lower if math.isfinite(lower) else min(close, upper) - half
            high = upper if math.isfinite(upper) else max(close, lower) + half
            positions.append(generator.uniform(low, high))
        return positions

    def starts(self, first: list[float], restarts: int, seed: Callable[[], Generator]) -> Iterator[list[float]]:
        """Yields start configurations of a search, each with n positions [rad or m].

        Args:
            first: The first configuration.
            restarts: Number of random configurations that follow.
            seed: Function that makes the random generator. This function is slow, and therefore only called when a
                second configuration is requested.
        """
        yield first
        generator = seed()
        for _ in range(restarts):
            yield self.random(generator, first)


def _turned(position: float, lower: float, upper: float) -> float:
    """Moves an angle by whole turns until the angle no longer exceeds the limit that was exceeded."""
    if position > upper:
        return position - TURN * math.ceil((position - upper - LIMIT_ROUNDING) / TURN)
    return position + TURN * math.ceil((lower - position - LIMIT_ROUNDING) / TURN)
