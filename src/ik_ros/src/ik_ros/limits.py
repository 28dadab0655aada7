"""Limits of joints, and how positions are brought into them."""

from __future__ import annotations

import logging
import math
import random
from collections.abc import Sequence

from rpbi.urdf.joints import LIMIT_ROUNDING

TURN = 2.0 * math.pi


class Limits:
    """Limits of n joints; plain numbers, since arrays of seven take longer.

    Args:
        lower: n lower limits [rad or m], -inf where there is none.
        upper: n upper limits [rad or m], inf where there is none.
        is_revolute: Which joints turn.

    Attributes:
        middle: n positions half-way between the limits, 0 or the limit next to it where there are not both.
    """

    def __init__(self, lower: Sequence[float], upper: Sequence[float], is_revolute: Sequence[bool]) -> None:
        self.lower, self.upper = tuple(lower), tuple(upper)
        self._joints = tuple(zip(self.lower, self.upper, is_revolute))
        self.middle = tuple(
            (low + high) / 2.0 if math.isfinite(high - low) else min(max(0.0, low), high)
            for low, high in zip(lower, upper)
        )

    def wrap_to_limits(self, q: Sequence[float], near: Sequence[float]) -> tuple[list[float], bool]:
        """Returns positions within the limits, and whether they are what was given but for whole turns and rounding.

        Args:
            q: n positions [rad or m].
            near: n positions; of several turns that fit, joints that turn take the one nearest to these.
        """
        inside, is_same = [], True
        for position, close, (lower, upper, is_revolute) in zip(q, near, self._joints):
            if is_revolute:
                position -= TURN * round((position - close) / TURN)
            if not lower <= position <= upper:
                turned = _turned(position, lower, upper) if is_revolute else position
                fits = lower - LIMIT_ROUNDING <= turned <= upper + LIMIT_ROUNDING
                is_same = is_same and fits
                position = min(max(turned if fits else position, lower), upper)
            inside.append(position)
        return inside, is_same

    def clip(self, q: Sequence[float]) -> list[float]:
        """Returns positions, each moved to the limit that it is beyond [rad or m]."""
        return [min(max(position, lower), upper) for position, lower, upper in zip(q, self.lower, self.upper)]

    def random(self, generator: random.Random, near: Sequence[float]) -> list[float]:
        """Returns random positions within the limits; half a turn or 1 m around `near` where there are none."""
        positions = []
        for close, (lower, upper, is_revolute) in zip(near, self._joints):
            half = math.pi if is_revolute else 1.0
            low = lower if math.isfinite(lower) else min(close, upper) - half
            high = upper if math.isfinite(upper) else max(close, lower) + half
            positions.append(generator.uniform(low, high))
        return positions


def _turned(position: float, lower: float, upper: float) -> float:
    """Returns an angle outside limits, turned towards them until it is not beyond the one that it was beyond."""
    if position > upper:
        return position - TURN * math.ceil((position - upper - LIMIT_ROUNDING) / TURN)
    return position + TURN * math.ceil((lower - position - LIMIT_ROUNDING) / TURN)


_log = logging.getLogger(__name__)


class StartLimits:
    """Brings starts into limits, and warns of each joint once: a stream asks the same a hundred times a second.

    Args:
        joint_names: The n joints.
        limits: Their limits.
    """

    def __init__(self, joint_names: Sequence[str], limits: Limits) -> None:
        self._joint_names = tuple(joint_names)
        self._limits = limits
        self._warned_of: set[str] = set()

    def wrap_to_limits(self, start: Sequence[float]) -> list[float]:
        """Returns n positions within limits [rad or m].

        Args:
            start: n positions [rad or m].
        """
        inside = self._limits.wrap_to_limits(start, start)[0]
        joints = zip(self._joint_names, start, inside)
        outside = {name: asked for name, asked, used in joints if abs(asked - used) > LIMIT_ROUNDING}
        if not outside.keys() <= self._warned_of:
            positions = ", ".join(f"'{name}' {asked:g}" for name, asked in outside.items())
            _log.warning("the start is outside limits and is brought in: %s", positions)
            self._warned_of |= outside.keys()
        return inside
