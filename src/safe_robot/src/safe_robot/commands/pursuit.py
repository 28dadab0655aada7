"""Motion of joints towards a target as fast as their limits allow, stopping there."""

from typing import NamedTuple

import numpy as np

from safe_robot.braking import INSIDE, Braking
from safe_robot.limits import MotionLimits
from safe_robot.motion import State

STEPS = 10
"""Number of commands tried between the hardest braking and the fastest motion, and again between two of them."""
ROUNDING = 1e-12
"""Positions that differ by less are equal [rad or m]."""


class Pursuit(NamedTuple):
    """Range of the commands that n joints can follow in the next period.

    Attributes:
        wanted: n reachable positions nearest to the targets [rad or m].
        slowest: n positions at the other end, for most a braking [rad or m].
    """

    wanted: np.ndarray
    slowest: np.ndarray


def pursue(
    target: np.ndarray,
    state: State,
    limits: MotionLimits,
    braking: Braking,
    period_s: float,
    stop: np.ndarray,
    acceleration: np.ndarray | None = None,
) -> Pursuit:
    """Returns the command nearest to n targets, a period later, without any joint having to pass its target.

    It keeps the limits of joints; checks decide whether the command is safe. If n accelerations [rad/s^2 or m/s^2] are
    given, it returns the command nearest to these instead. The shortest braking from a new state may be longer than the
    rest of the present braking, and pass a target that the present one does not pass. Such joints continue the present
    braking.

    Args:
        target: n positions [rad or m].
        state: State before the command.
        limits: Limits of the joints.
        braking: Computes their braking.
        period_s: Time between two commands [s].
        stop: Commands of the present braking, k x n [rad or m].
        acceleration: n accelerations.
    """
    target = np.clip(target, limits.lower, limits.upper)
    exact = state.then(target, period_s).acceleration if acceleration is None else acceleration
    jerk, hardest, speed = (INSIDE * each for each in (limits.jerk, limits.acceleration, limits.velocity))
    low = np.maximum(-hardest, state.acceleration - jerk * period_s)
    high = np.minimum(hardest, state.acceleration + jerk * period_s)
    low = np.maximum((-speed - state.velocity) / period_s, low)
    high = np.minimum((speed - state.velocity) / period_s, high)
    low, high = np.where(np.isfinite(low), low, exact), np.where(np.isfinite(high), high, exact)
    sense = np.sign(target - state.position)
    fastest = np.minimum(np.maximum(exact, low), high)
    slowest = np.where(sense > 0.0, low, high)
    at = np.zeros(len(target))  # from 0, slowest, to 1, fastest
    joints = np.arange(len(target))
    for width in (1.0, 1.0 / STEPS):
        shares = np.minimum(at + width * (np.arange(STEPS + 1.0) / STEPS)[:, None], 1.0)
        tried = slowest + shares * (fastest - slowest)
        velocity = state.velocity + period_s * tried
        braking_distance, braking_speed = braking.ends(velocity, tried)
        end = state.position + period_s * velocity + braking_distance
        stays = (sense * (end - target) <= ROUNDING) & (braking_speed <= speed)
        last = np.where(stays.any(axis=0), STEPS - stays[::-1].argmax(axis=0), 0)
        at = shares[last, joints]
        if width == 1.0:
            keeps_braking = ~stays.any(axis=0) & (sense * (stop[-1] - target) <= ROUNDING)
    chosen = slowest + at * (fastest - slowest)
    wanted, other = (state.position + period_s * (state.velocity + period_s * each) for each in (chosen, slowest))
    return Pursuit(np.where(keeps_braking, stop[0], wanted), other)
