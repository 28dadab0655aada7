"""How joints come near a target as fast as their limits allow, stop there, and keep out of what is in the way."""

from collections.abc import Sequence
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np

from .braking import INSIDE, Braking
from .limits import JointLimits
from .motion import State

STEPS = 10
"""Between braking hard and going on as fast as possible so many commands are tried, and as many between two of them."""
ROUNDING = 1e-12
"""Positions that differ by less are equal [rad or m]."""


class Bound(NamedTuple):
    """What a robot has to keep where it comes to rest: `gradient @ (end - there) >= -room`, with `there` as asked for.

    Attributes:
        gradient: n values, how something safe grows as joints move.
        room: How much of it is left, 0 at least.
    """

    gradient: np.ndarray
    room: float


class Pursuit(NamedTuple):
    """What n joints can do in the next period: anything from one to the other.

    Attributes:
        wanted: n positions that come nearest to the targets [rad or m].
        slowest: n positions at the other end, for most a braking [rad or m].
    """

    wanted: np.ndarray
    slowest: np.ndarray


def can_keep_bounds() -> bool:
    """Returns whether the solver of quadratic programs is installed: DAQP, of the extra `ik`."""
    return find_spec("daqp") is not None


def pursue(
    target: np.ndarray,
    state: State,
    limits: JointLimits,
    braking: Braking,
    period_s: float,
    acceleration: np.ndarray | None = None,
) -> Pursuit:
    """Returns what comes nearest to n targets, a period later, without any joint having to go past its.

    It keeps the limits of joints; whether the command is safe is for checks to say. What comes nearest to
    n accelerations [rad/s^2 or m/s^2], if they are given, takes the place of what comes nearest to the targets.
    """
    target = np.clip(target, limits.lower, limits.upper)
    exact = state.then(target, period_s).acceleration if acceleration is None else acceleration
    jerk, hardest, speed = (INSIDE * each for each in (limits.jerk, limits.acceleration, limits.velocity))
    low = np.maximum(-hardest, state.acceleration - jerk * period_s)
    high = np.minimum(hardest, state.acceleration + jerk * period_s)
    low = np.maximum((-speed - state.velocity) / period_s, low)
    high = np.minimum((speed - state.velocity) / period_s, high)
    low, high = np.where(np.isfinite(low), low, exact), np.where(np.isfinite(high), high, exact)
    way = np.sign(target - state.position)
    fastest = np.minimum(np.maximum(exact, low), high)
    slowest = np.where(way > 0.0, low, high)
    at = np.zeros(len(target))  # from 0, slowest, to 1, fastest
    joints = np.arange(len(target))
    for width in (1.0, 1.0 / STEPS):
        shares = np.minimum(at + width * (np.arange(STEPS + 1.0) / STEPS)[:, None], 1.0)
        tried = slowest + shares * (fastest - slowest)
        velocity = state.velocity + period_s * tried
        way_on, fastest_on = braking.ends(velocity, tried)
        end = state.position + period_s * velocity + way_on
        stays = (way * (end - target) <= ROUNDING) & (fastest_on <= speed)
        last = np.where(stays.any(axis=0), STEPS - stays[::-1].argmax(axis=0), 0)
        at = shares[last, joints]
    chosen = slowest + at * (fastest - slowest)
    return Pursuit(*(state.position + period_s * (state.velocity + period_s * each) for each in (chosen, slowest)))


class Ends:
    """Where n joints come to rest, which near a command is linear in it.

    Args:
        command: n positions [rad or m].
        state: The state before it.
        period_s: The period [s].
    """

    def __init__(self, command: np.ndarray, state: State, braking: Braking, period_s: float) -> None:
        after = state.then(command, period_s)
        by_velocity, by_acceleration = braking.end_factors(after.velocity, after.acceleration)
        still = state.then(state.position, period_s)
        self.slope = 1.0 + by_velocity / period_s + by_acceleration / period_s**2
        self.offset = state.position + by_velocity * still.velocity + by_acceleration * still.acceleration
        self._start = state.position

    def of(self, command: np.ndarray) -> np.ndarray:
        """Returns where they come to rest after a command."""
        return self.offset + self.slope * (command - self._start)


def within_bounds(
    wanted: np.ndarray, least: np.ndarray, most: np.ndarray, bounds: Sequence[Bound], ends: Ends, there: np.ndarray
) -> np.ndarray | None:
    """Returns the command nearest to one that is wanted, between two others, whose end is within bounds.

    Args:
        wanted: n positions [rad or m].
        least: n positions.
        most: n positions, none below those of `least`.
        bounds: The bounds.
        ends: Where joints come to rest.
        there: Where they are what the bounds were asked for.

    Returns:
        n positions; None if there are none.
    """
    import daqp  # of the extra `ik`

    rows = np.array([bound.gradient for bound in bounds])
    room = np.array([bound.room for bound in bounds]) + rows @ (ends.of(wanted) - there)
    n = len(wanted)
    scale = np.maximum(most - least, 1e-9)  # of each joint, so that a quadratic program has ordinary numbers
    matrix = np.ascontiguousarray(rows * ends.slope * scale)
    upper = np.concatenate(((most - wanted) / scale, np.full(len(bounds), 1e30)))
    lower = np.concatenate(((least - wanted) / scale, -room))
    scaled, _, flag, _ = daqp.solve(np.diag(scale * scale) / scale.max() ** 2, np.zeros(n), matrix, upper, lower)
    found = wanted + scale * scaled
    return np.clip(found, least, most) if flag > 0 and np.isfinite(found).all() else None
