"""Computes commands that move joints to a target as fast as the limits allow, and stop the joints at the target."""

from typing import NamedTuple

import numpy as np

from safe_robot.braking import INSIDE, Braking
from safe_robot.limits import MotionLimits
from safe_robot.motion import State

STEPS = 10
"""Number of equal intervals into which the range from the slowest to the fastest command is divided.

The commands at the `STEPS + 1` ends of the intervals are tried. The interval above the fastest suitable command is
divided once more in the same way.
"""
ROUNDING = 1e-12
"""A target that is passed by at most this counts as not passed [rad or m]."""


class Pursuit(NamedTuple):
    """Range of the commands that n joints can follow in the next period.

    Attributes:
        wanted: Commanded positions at that end of the range which is nearer to the targets, shape (n,) [rad or m].
        slowest: Commanded positions at the other end, with the smallest accelerations towards the targets, shape (n,)
            [rad or m].
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
    """Returns the range of commands for the next period; see `Pursuit`.

    After the command `wanted`, each joint can still brake without passing its target. If a joint has no such command,
    `wanted` continues the joint's present braking, provided that this braking does not pass the target. Otherwise, the
    joint gets the slowest command. Commands respect the joint limits, but are not yet examined by safety checks.

    Args:
        target: Target positions, shape (n,) [rad or m].
        state: State before the command.
        limits: Limits of the joints.
        braking: Computes the braking of the joints.
        period_s: Time between two commands [s].
        stop: Commands of the present braking, shape (k, n) [rad or m].
        acceleration: Desired accelerations, shape (n,) [rad/s^2 or m/s^2]. None: the accelerations that reach the
            targets in one period.
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
    at = np.zeros(len(target))  # 0: slowest command, 1: fastest command
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
