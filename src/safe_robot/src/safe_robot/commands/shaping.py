"""Smoothing of targets that joints cannot follow within their limits; runs before the checks."""

from typing import Annotated

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Positive, Seconds, Unit
from safe_robot.braking import Braking
from safe_robot.limits import MotionLimits
from safe_robot.motion import State

from .pursuit import pursue

CAUGHT_UP_SHARE = 0.05
"""A joint has caught up if it needs at most this share of its acceleration and jerk limits to reach its target."""
OVERSHOOT = 0.01
"""Targets that exceed a position limit by at most this are moved to the limit: motors overshoot as much [rad or m]."""


class ShapingConfig(ConfigModel):
    """Options for smoothing targets that the joints cannot follow within their limits."""

    time_s: Annotated[Seconds, Field(ge=1e-4)] = Field(
        0.03, description="Time constant of the filter. Smoothed commands lag behind targets by about twice this time."
    )
    reach: Annotated[Positive, Unit("rad or m")] = Field(
        0.25,
        description="Largest distance of a target from the last command. A target that is further away is not "
        "smoothed.",
    )


class Shaper:
    """Computes commands that follow targets of n joints within the limits of velocity, acceleration and jerk.

    Targets that respect these limits are passed on unchanged. After a target that violates a limit, commands follow the
    targets like a critically damped second-order filter, within the limits and without overshoot. This filter stays
    active until all joints have caught up with their targets. Jitter of targets therefore does not reach the robot.

    Args:
        config: Parameters of the smoothing.
        limits: Limits of the joints.
        braking: Computes the braking of the joints.
        period_s: Time between two commands [s].
    """

    def __init__(self, config: ShapingConfig, limits: MotionLimits, braking: Braking, period_s: float) -> None:
        self._reach, self._rate = config.reach, 1.0 / config.time_s
        self._limits, self._braking, self._period_s = limits, braking, period_s
        self._is_behind = False

    def shaped(self, target: tuple[float, ...], state: State, stop: np.ndarray) -> tuple[float, ...]:
        """Returns the next command towards a target, n positions [rad or m].

        A target that the joints can follow is returned, clipped to the position limits. For a target that is too fast,
        the command brings the joints nearer to it. A target that jumps by more than the option `reach`, or exceeds a
        position limit by more than `OVERSHOOT`, is returned unchanged, so that the guard's checks refuse it.

        Args:
            target: n positions [rad or m].
            state: Present state of the robot.
            stop: Commands of the braking from this state, shape (k, n) [rad or m].
        """
        asked = np.array(target)
        position = asked.clip(self._limits.lower, self._limits.upper)
        if not ((np.abs(asked - state.position) <= self._reach) & (np.abs(asked - position) <= OVERSHOOT)).all():
            return target
        if self._can_command(position, state):
            self._is_behind = False
            return tuple(position.tolist())
        self._is_behind = True
        acceleration = self._smooth(position, state)
        wanted = pursue(position, state, self._limits, self._braking, self._period_s, stop, acceleration).wanted
        return tuple(wanted.tolist())

    def _can_command(self, position: np.ndarray, state: State) -> bool:
        """Returns whether the joints can reach a position in one period and then stop, within their limits.

        While the filter is active, the acceleration and jerk must be at most `CAUGHT_UP_SHARE` of their limits.
        """
        limits, share = self._limits, CAUGHT_UP_SHARE if self._is_behind else 1.0
        after = state.then(position, self._period_s)
        jerk = (after.acceleration - state.acceleration) / self._period_s
        way, fastest = self._braking.ends(after.velocity[None], after.acceleration[None])
        end = position + way[0]  # NaN where there is no braking: all comparisons are false
        return bool(
            (
                (fastest[0] <= limits.velocity)
                & (np.abs(after.acceleration) <= share * limits.acceleration)
                & (np.abs(jerk) <= share * limits.jerk)
                & (end >= limits.lower)
                & (end <= limits.upper)
            ).all()
        )

    def _smooth(self, position: np.ndarray, state: State) -> np.ndarray:
        """Returns the filter's accelerations towards a target position, shape (n,) [rad/s^2 or m/s^2].

        The filter is integrated with the implicit Euler method.
        """
        rate, period_s = self._rate, self._period_s
        way = position - state.position - period_s * state.velocity
        acceleration: np.ndarray = (rate * rate * way - 2.0 * rate * state.velocity) / (1.0 + rate * period_s) ** 2
        return acceleration
