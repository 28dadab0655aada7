"""How joints come near a target as fast as their limits allow, stop there, and keep out of what is in the way."""

from collections.abc import Sequence
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np

from safe_robot.limits import JointLimits
from safe_robot.motion import State

from .braking import INSIDE, Braking

STEPS = 10
"""Between braking hard and going on as fast as possible so many commands are tried, and as many between two of them."""
MOMENTS = 5
"""Of the way to rest so many moments are looked at where something is near."""
ROUNDING = 1e-12
"""Positions that differ by less are equal [rad or m]."""


class Bound(NamedTuple):
    """What a robot has to keep where it comes to rest: `gradient @ (end - there) >= -room`, with `there` as asked for.

    Attributes:
        gradient: n values, how something safe grows as joints move.
        room: How much of it is left; negative where it is missing.
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


class Stop:
    """How n joints come to rest after a command: where they are at some moments, near the command linear in it.

    Args:
        command: n positions [rad or m].
        state: The state before it.
        period_s: The period [s].

    Attributes:
        slope: How each moment moves with the command, MOMENTS x n; the first is that of the command, the last the end.
    """

    def __init__(self, command: np.ndarray, state: State, braking: Braking, period_s: float) -> None:
        after = state.then(command, period_s)
        by_velocity, by_acceleration = braking.factors(after.velocity, after.acceleration, MOMENTS)
        still = state.then(state.position, period_s)
        self.slope = 1.0 + by_velocity / period_s + by_acceleration / period_s**2
        self._offset = state.position + by_velocity * still.velocity + by_acceleration * still.acceleration
        self._start = state.position

    def of(self, command: np.ndarray) -> np.ndarray:
        """Returns where they are after a command, MOMENTS x n."""
        return self._offset + self.slope * (command - self._start)


class Detour:
    """The command nearest to one that is wanted, between two others, with which bounds are kept until the robot rests.

    Bounds are linear, while what they stand for seldom is. So where a command turns out to be bad, more are added that
    are true there, and the next one is better.

    Args:
        wanted: n positions [rad or m].
        other: n positions, at the other end of what is possible.
    """

    def __init__(self, wanted: np.ndarray, other: np.ndarray) -> None:
        self._wanted = wanted
        self._least, self._most = np.minimum(wanted, other), np.maximum(wanted, other)
        self._rows: list[np.ndarray] = []
        self._rooms: list[float] = []

    def add(self, bounds: Sequence[Bound], at: np.ndarray, stop: Stop, moment: int) -> None:
        """Adds bounds of a moment of the way to rest that are true near n positions."""
        for gradient, room in bounds:
            self._rows.append(gradient * stop.slope[moment])
            self._rooms.append(room + float(gradient @ (stop.of(self._wanted)[moment] - at)))

    def command(self) -> np.ndarray | None:
        """Returns the command, n positions; None if there is none."""
        import daqp  # of the extra `ik`

        wanted, n = self._wanted, len(self._wanted)
        if not self._rows:
            return wanted
        scale = np.maximum(self._most - self._least, 1e-9)  # of joints, so that the program has ordinary numbers
        matrix = np.ascontiguousarray(np.array(self._rows) * scale)
        upper = np.concatenate(((self._most - wanted) / scale, np.full(len(matrix), 1e30)))
        lower = np.concatenate(((self._least - wanted) / scale, -np.array(self._rooms)))
        scaled, _, flag, _ = daqp.solve(np.diag(scale * scale) / scale.max() ** 2, np.zeros(n), matrix, upper, lower)
        found = wanted + scale * scaled
        return np.clip(found, self._least, self._most) if flag > 0 and np.isfinite(found).all() else None
