"""Dynamics of movement primitives: a path, and a spring-damper for the deviation from it, with forcing term and
couplings.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from custom_ros_tools.transforms import Array

from .space import Space, angular_velocity, turned

TOLERANCE = 1e-3
"""Largest distance from the goal that counts as reached [m or rad]."""
TOLERANCE_RAD = math.radians(0.1)
"""Largest angle from the goal that counts as reached [rad]."""
FROM_START = (0.0, 0.0, 0.0, 10.0, -15.0, 6.0)
"""Quintic from 0 to 1, from rest to rest; coefficients of rising powers."""
COASTING = (0.0, 1.0, 0.0, -6.0, 8.0, -3.0)
"""Quintic from 0 to 0, from velocity 1 to rest; acceleration is 0 at both ends."""
MIN_CHANGE_SHARE = 0.25
"""Least duration of a change of the goal, as a share of the motion's duration."""


class MotionState(NamedTuple):
    """State of a motion.

    Attributes:
        time_s: Time since its start [s].
        point: A point of its space.
        velocity: Velocity [m/s or rad/s], shape (dof,).
    """

    time_s: float
    point: Array
    velocity: Array


class SpringDamper(NamedTuple):
    """Critically damped spring; its time scale is the duration.

    Attributes:
        alpha: Damping; the stiffness is a quarter of its square, both for a duration of 1 s.
        duration_s: The duration [s].
    """

    alpha: float
    duration_s: float

    @property
    def stiffness(self) -> float:
        """Acceleration per distance [1/s^2]."""
        return 0.25 * self.alpha**2 / self.duration_s**2

    @property
    def damping(self) -> float:
        """Acceleration per velocity [1/s]."""
        return self.alpha / self.duration_s


Coupling = Callable[[MotionState, SpringDamper], Array]
"""Returns an acceleration [m/s^2 or rad/s^2], shape (dof,), for a state and the spring of the motion."""


class Execution(ABC):
    """A motion that is executed step by step.

    Attributes:
        space: Its signals.
        state: Its present state.
        goal: The last point, None if there is no goal.
    """

    space: Space
    state: MotionState
    goal: Array | None

    @property
    @abstractmethod
    def end_s(self) -> float:
        """Planned time at the goal [s]."""

    @abstractmethod
    def step(self, dt_s: float, couplings: Sequence[Coupling] = ()) -> MotionState:
        """Advances by a time step [s] and returns the new state.

        Args:
            couplings: Functions of state and spring that return further accelerations.
        """

    @abstractmethod
    def set_goal(self, goal: ArrayLike) -> None:
        """Sets another goal from now on.

        Raises:
            PlanError: If it is not a point of the space, or it is too late to change the goal of this primitive.
        """

    def miss(self) -> tuple[float, float]:
        """Returns the largest distance from the goal [m or rad], and the angle from it [rad]; 0 without a goal."""
        return (0.0, 0.0) if self.goal is None else self.space.distance(self.state.point, self.goal)

    def is_at_goal(self, tolerance: float = TOLERANCE, tolerance_rad: float = TOLERANCE_RAD) -> bool:
        """Returns whether the duration has passed and the goal is reached."""
        distance, angle_rad = self.miss()
        is_over = self.state.time_s >= self.end_s * (1.0 - 1e-9)
        return is_over and distance <= tolerance and angle_rad <= tolerance_rad


class Path(Protocol):
    """The path that a motion deviates from."""

    end_s: float
    """Time after which it is at rest [s]."""

    def at(self, time_s: float) -> tuple[Array, Array]:
        """Returns point and velocity, shape (dof,)."""

    def set_goal(self, goal: Array, time_s: float) -> None:
        """Changes the goal at a time of the motion."""


class QuinticOffset(NamedTuple):
    """A difference that is added to a path along a quintic.

    Attributes:
        start_s: Time at which it starts [s].
        duration_s: How long it lasts [s].
        difference: The difference, shape (dof,).
        quintic: Its share over the share of the duration, as coefficients of rising powers.
    """

    start_s: float
    duration_s: float
    difference: Array
    quintic: tuple[float, ...] = FROM_START

    def at(self, time_s: float) -> tuple[float, float]:
        """Returns the share that is added, and its derivative by time [1/s]."""
        u = min(max((time_s - self.start_s) / self.duration_s, 0.0), 1.0)
        _, c1, c2, c3, c4, c5 = self.quintic
        value = u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5))))
        rate = c1 + u * (2.0 * c2 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))
        return value, rate / self.duration_s


class QuinticPath:
    """A path from start to goal along a quintic, which arrives in time (as the goal of Muelling 2013, equation 6).

    A new goal adds another quintic: velocity and acceleration stay continuous.

    Args:
        velocity: Velocity at the start [m/s or rad/s], shape (dof,).
    """

    def __init__(self, space: Space, duration_s: float, start: Array, goal: Array, velocity: Array) -> None:
        self._space, self._duration_s, self._start, self._goal = space, duration_s, start, goal
        self.end_s = duration_s
        self._moves = [QuinticOffset(0.0, duration_s, space.minus(goal, start))]
        if velocity.any():
            self._moves.append(QuinticOffset(0.0, duration_s, velocity * duration_s, COASTING))

    def set_goal(self, goal: Array, time_s: float) -> None:
        """Changes the goal; it is reached at the end, or after a quarter of the duration if that is later."""
        left_s = max(self._duration_s - time_s, MIN_CHANGE_SHARE * self._duration_s)
        self._moves.append(QuinticOffset(time_s, left_s, self._space.minus(goal, self._goal)))
        self._goal, self.end_s = goal, max(self.end_s, time_s + left_s)

    def at(self, time_s: float) -> tuple[Array, Array]:
        """Returns point and velocity, shape (dof,)."""
        point, velocity = self._start, np.zeros(self._space.dof)
        for move in self._moves:
            value, rate = move.at(time_s)
            point, velocity = deviated(self._space, point, velocity, value * move.difference, rate * move.difference)
        return point, velocity


class PathExecution(Execution):
    """A motion that deviates from a path: a spring pulls it back, a forcing term and couplings push it away.

    The deviation follows one linear equation for all signals, in one phase; orientations are rotation vectors. It is
    that of Ijspeert 2013 (equation 2.1), with the path in place of the goal.

    Args:
        forcing: Acceleration at a time [m/s^2 or rad/s^2], shape (dof,).
        goal: Where the path ends, None if the motion has no goal.
    """

    def __init__(
        self,
        space: Space,
        spring: SpringDamper,
        path: Path,
        forcing: Callable[[float], Array],
        goal: Array | None,
    ) -> None:
        self.space, self.spring, self.goal, self.path, self._forcing = space, spring, goal, path, forcing
        self._flat = Space(tuple(map(str, range(space.dof))))
        self.deviation = MotionState(0.0, np.zeros(space.dof), np.zeros(space.dof))
        self.state = self._moved(self.deviation)

    @property
    def end_s(self) -> float:
        """Planned time at the goal [s]."""
        return self.path.end_s

    def step(self, dt_s: float, couplings: Sequence[Coupling] = ()) -> MotionState:
        """Advances by a time step, see `Execution`."""
        spring = self.spring

        def acceleration(deviation: MotionState) -> Array:
            found = self._forcing(deviation.time_s)
            found = found - spring.stiffness * deviation.point - spring.damping * deviation.velocity
            moved = self._moved(deviation) if couplings else deviation
            return sum((each(moved, spring) for each in couplings), found)

        self.deviation = integrated(self._flat, acceleration, self.deviation, dt_s)
        self.state = self._moved(self.deviation)
        return self.state

    def set_goal(self, goal: ArrayLike) -> None:
        """Changes the goal, see `Execution`."""
        checked = self.space.point(goal, "goal")
        self.path.set_goal(checked, self.state.time_s)
        self.goal = checked

    def start_at(self, point: Array, velocity: Array) -> None:
        """Starts at a point off the path, with a velocity."""
        shift = self.space.minus(point, self.path.at(0.0)[0])
        self.start_beside(shift, self.space.shift_rate(shift, velocity))

    def start_beside(self, shift: Array, rate: Array) -> None:
        """Starts at an offset from the path, shape (dof,), with a rate of the offset."""
        self.deviation = MotionState(0.0, shift, rate)
        self.state = self._moved(self.deviation)

    def _moved(self, deviation: MotionState) -> MotionState:
        point, velocity = self.path.at(deviation.time_s)
        return MotionState(
            deviation.time_s, *deviated(self.space, point, velocity, deviation.point, deviation.velocity)
        )


def deviated(space: Space, point: Array, velocity: Array, shift: Array, rate: Array) -> tuple[Array, Array]:
    """Returns point and velocity of a motion offset from another one by `shift`, which changes at `rate`."""
    if not space.has_orientation:
        return point + shift, velocity + rate
    n = len(space.names)
    angular = angular_velocity(shift[n:], rate[n:]) + turned(shift[n:], velocity[n:])
    return space.plus(point, shift), np.concatenate([velocity[:n] + rate[:n], angular])


def integrated(
    space: Space, acceleration: Callable[[MotionState], Array], state: MotionState, dt_s: float
) -> MotionState:
    """Returns the state a time step later, by the Runge-Kutta method of order 4 (of Munthe-Kaas, for orientations)."""
    half_s = 0.5 * dt_s

    def slope(share_s: float, shift: Array, velocity: Array) -> tuple[Array, Array]:
        at = MotionState(state.time_s + share_s, space.plus(state.point, shift), velocity)
        return space.shift_rate(shift, velocity), acceleration(at)

    rate_1, bend_1 = slope(0.0, np.zeros(space.dof), state.velocity)
    rate_2, bend_2 = slope(half_s, half_s * rate_1, state.velocity + half_s * bend_1)
    rate_3, bend_3 = slope(half_s, half_s * rate_2, state.velocity + half_s * bend_2)
    rate_4, bend_4 = slope(dt_s, dt_s * rate_3, state.velocity + dt_s * bend_3)
    shift = dt_s / 6.0 * (rate_1 + 2.0 * (rate_2 + rate_3) + rate_4)
    bend = dt_s / 6.0 * (bend_1 + 2.0 * (bend_2 + bend_3) + bend_4)
    return MotionState(state.time_s + dt_s, space.plus(state.point, shift), state.velocity + bend)
