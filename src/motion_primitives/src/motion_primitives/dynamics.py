"""Dynamics of movement primitives: a spring-damper pulls a motion to a path, and a forcing term and couplings push the
motion off the path.
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
"""Largest difference of a position from the goal at which the goal counts as reached [m or rad]."""
TOLERANCE_RAD = math.radians(0.1)
"""Largest angle between the orientation and the goal's orientation at which the goal counts as reached [rad]."""
FROM_START = (0.0, 0.0, 0.0, 10.0, -15.0, 6.0)
"""Coefficients (powers 0 to 5) of the quintic polynomial from 0 to 1 that starts and ends at rest."""
COASTING = (0.0, 1.0, 0.0, -6.0, 8.0, -3.0)
"""Coefficients (powers 0 to 5) of the quintic polynomial from 0 to 0 that starts with velocity 1 and ends at rest. The
second derivative is 0 at both ends."""
MIN_CHANGE_SHARE = 0.25
"""Smallest duration of the transition to a new goal, as a fraction of the motion's duration."""


class MotionState(NamedTuple):
    """State of a motion at a time.

    Attributes:
        time_s: Time since the start of the motion [s].
        point: Point at this time, see `Space`.
        velocity: Velocity at this time, shape (dof,) [m/s or rad/s].
    """

    time_s: float
    point: Array
    velocity: Array


class SpringDamper(NamedTuple):
    """Critically damped spring, whose time scale is the duration of the motion.

    Attributes:
        alpha: Damping for a duration of 1 s [1/s]. The stiffness for a duration of 1 s is `alpha**2 / 4` [1/s^2].
        duration_s: Duration of the motion [s].
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
"""Function of a motion's state and spring-damper; returns an acceleration to add, shape (dof,) [m/s^2 or rad/s^2]."""


class Execution(ABC):
    """A motion that is executed step by step.

    Attributes:
        space: Space of the motion's points.
        state: Current state.
        goal: Point where the motion should end; None for a motion without goal.
    """

    space: Space
    state: MotionState
    goal: Array | None

    @property
    @abstractmethod
    def end_s(self) -> float:
        """Planned duration: time from the start to the goal [s]."""

    @abstractmethod
    def step(self, dt_s: float, couplings: Sequence[Coupling] = ()) -> MotionState:
        """Advances the motion by one time step, and returns the new state.

        Args:
            dt_s: The time step [s].
            couplings: Functions that return accelerations to add, see `Coupling`.
        """

    @abstractmethod
    def set_goal(self, goal: ArrayLike) -> None:
        """Changes the goal of the running motion.

        Raises:
            PlanError: If `goal` is not a point of the space, or it is too late to change the goal.
        """

    def miss(self) -> tuple[float, float]:
        """Returns the current distance from the goal; both values are 0 for a motion without goal.

        Returns:
            Largest difference of a position [m or rad], and angle between the orientations [rad].
        """
        return (0.0, 0.0) if self.goal is None else self.space.distance(self.state.point, self.goal)

    def is_at_goal(self, tolerance: float = TOLERANCE, tolerance_rad: float = TOLERANCE_RAD) -> bool:
        """Returns whether the planned duration has passed and the goal is reached.

        Args:
            tolerance: Largest difference of a position from the goal that counts as reached [m or rad].
            tolerance_rad: Largest angle between the orientations that counts as reached [rad].
        """
        distance, angle_rad = self.miss()
        is_over = self.state.time_s >= self.end_s * (1.0 - 1e-9)
        return is_over and distance <= tolerance and angle_rad <= tolerance_rad


class Path(Protocol):
    """The nominal path of a motion, without forcing term and couplings."""

    end_s: float
    """Time from which the path is at rest [s]."""

    def at(self, time_s: float) -> tuple[Array, Array]:
        """Returns the point and the velocity, shape (dof,), at a time since the start [s]."""

    def set_goal(self, goal: Array, time_s: float) -> None:
        """Changes the path from `time_s` [s] on so that the path ends at a new goal."""


class QuinticOffset(NamedTuple):
    """An offset that is added to a path: a difference times a quintic polynomial of time.

    Attributes:
        start_s: Time at which the polynomial starts [s].
        duration_s: Duration of the polynomial [s]. Before its start, its first value is used; after its end, its last.
        difference: The difference, shape (dof,).
        quintic: Coefficients (powers 0 to 5) of the polynomial, whose argument runs from 0 to 1 over the duration.
    """

    start_s: float
    duration_s: float
    difference: Array
    quintic: tuple[float, ...] = FROM_START

    def at(self, time_s: float) -> tuple[float, float]:
        """Returns the factor of `difference` at a time [s], and the factor's time derivative [1/s]."""
        u = min(max((time_s - self.start_s) / self.duration_s, 0.0), 1.0)
        _, c1, c2, c3, c4, c5 = self.quintic
        value = u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5))))
        rate = c1 + u * (2.0 * c2 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))
        return value, rate / self.duration_s


class QuinticPath:
    """A path along a quintic polynomial, from start to goal in a given duration (cf. Muelling 2013, equation 6).

    A new goal adds another polynomial, so that velocity and acceleration stay continuous.

    Args:
        space: Space of the points.
        duration_s: Duration of the path [s].
        start: First point.
        goal: Last point.
        velocity: Velocity at the start, shape (dof,) [m/s or rad/s].
    """

    def __init__(self, space: Space, duration_s: float, start: Array, goal: Array, velocity: Array) -> None:
        self._space, self._duration_s, self._start, self._goal = space, duration_s, start, goal
        self.end_s = duration_s
        self._moves = [QuinticOffset(0.0, duration_s, space.minus(goal, start))]
        if velocity.any():
            self._moves.append(QuinticOffset(0.0, duration_s, velocity * duration_s, COASTING))

    def set_goal(self, goal: Array, time_s: float) -> None:
        """Changes the goal at the time `time_s` [s].

        The path arrives at the new goal at the end of the duration, or a quarter of the duration after `time_s`,
        whichever is later.
        """
        left_s = max(self._duration_s - time_s, MIN_CHANGE_SHARE * self._duration_s)
        self._moves.append(QuinticOffset(time_s, left_s, self._space.minus(goal, self._goal)))
        self._goal, self.end_s = goal, max(self.end_s, time_s + left_s)

    def at(self, time_s: float) -> tuple[Array, Array]:
        """Returns the point and the velocity, shape (dof,), at a time since the start [s]."""
        point, velocity = self._start, np.zeros(self._space.dof)
        for move in self._moves:
            value, rate = move.at(time_s)
            point, velocity = deviated(self._space, point, velocity, value * move.difference, rate * move.difference)
        return point, velocity


class PathExecution(Execution):
    """A motion that a spring-damper pulls to a path, while a forcing term and couplings push it off the path.

    All components of the deviation from the path follow the same linear equation (Ijspeert 2013, equation 2.1, with the
    path in place of the goal). Deviations of orientations are rotation vectors.

    Args:
        space: Space of the points.
        spring: The spring-damper.
        path: The path.
        forcing: Function of the time since the start [s] that returns an acceleration, shape (dof,) [m/s^2 or rad/s^2].
        goal: Point where the path ends; None for a motion without goal.

    Attributes:
        deviation: A `MotionState` that contains the current deviation from the path, shape (dof,), as the point, and
            the deviation's time derivative, shape (dof,), as the velocity.
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
        """Planned duration [s]."""
        return self.path.end_s

    def step(self, dt_s: float, couplings: Sequence[Coupling] = ()) -> MotionState:
        """Advances the motion by one time step, see `Execution`."""
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
        """Sets the initial state to a point and a velocity, shape (dof,). The point need not be on the path."""
        shift = self.space.minus(point, self.path.at(0.0)[0])
        self.start_beside(shift, self.space.shift_rate(shift, velocity))

    def start_beside(self, shift: Array, rate: Array) -> None:
        """Sets the initial offset from the path, and the offset's time derivative, both of shape (dof,)."""
        self.deviation = MotionState(0.0, shift, rate)
        self.state = self._moved(self.deviation)

    def _moved(self, deviation: MotionState) -> MotionState:
        point, velocity = self.path.at(deviation.time_s)
        return MotionState(
            deviation.time_s, *deviated(self.space, point, velocity, deviation.point, deviation.velocity)
        )


def deviated(space: Space, point: Array, velocity: Array, shift: Array, rate: Array) -> tuple[Array, Array]:
    """Adds an offset to the state of a motion.

    Args:
        space: Space of the points.
        point: Point of the motion.
        velocity: Velocity of the motion, shape (dof,).
        shift: The offset, shape (dof,).
        rate: Time derivative of the offset, shape (dof,).

    Returns:
        Point and velocity with the offset.
    """
    if not space.has_orientation:
        return point + shift, velocity + rate
    n = len(space.names)
    angular = angular_velocity(shift[n:], rate[n:]) + turned(shift[n:], velocity[n:])
    return space.plus(point, shift), np.concatenate([velocity[:n] + rate[:n], angular])


def integrated(
    space: Space, acceleration: Callable[[MotionState], Array], state: MotionState, dt_s: float
) -> MotionState:
    """Integrates a state over one time step with the Runge-Kutta method of order 4 (Munthe-Kaas for orientations).

    Args:
        space: Space of the points.
        acceleration: Function of the state that returns the acceleration, shape (dof,).
        state: State before the step.
        dt_s: The time step [s].
    """
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
