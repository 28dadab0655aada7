"""How joints come near a target as fast as their limits allow, and stop there."""

import numpy as np

from .braking import Braking
from .limits import JointLimits
from .motion import State

STEPS = 8
"""Between braking as hard and going on as fast as possible so many commands are tried."""


def pursue(target: np.ndarray, state: State, limits: JointLimits, braking: Braking, period_s: float) -> np.ndarray:
    """Returns the n positions, a period later, that come nearest to n targets without any joint having to go past its.

    It keeps the limits of joints; whether the command is safe is for checks to say.
    """
    target = np.clip(target, limits.lower, limits.upper)
    exact = ((target - state.position) / period_s - state.velocity) / period_s
    low = np.maximum(-limits.acceleration, state.acceleration - limits.jerk * period_s)
    high = np.minimum(limits.acceleration, state.acceleration + limits.jerk * period_s)
    low = np.maximum((-limits.velocity - state.velocity) / period_s, low)
    high = np.minimum((limits.velocity - state.velocity) / period_s, high)
    low, high = np.where(np.isfinite(low), low, exact), np.where(np.isfinite(high), high, exact)
    way = np.sign(target - state.position)
    fastest = np.minimum(np.maximum(exact, low), high)
    chosen = slowest = np.where(way > 0.0, low, high)
    for step in range(1, STEPS + 1):
        acceleration = slowest + step / STEPS * (fastest - slowest)
        velocity = state.velocity + period_s * acceleration
        brake = braking.plan(velocity, acceleration)
        if brake is not None:
            end = state.position + period_s * velocity + brake.displacement[-1]
            chosen = np.where(way * (end - target) <= 1e-12, acceleration, chosen)
    return state.position + period_s * (state.velocity + period_s * chosen)
