"""Discrete dynamic movement primitives."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from custom_ros_tools.schema import ConfigModel, ListOf, Seconds
from custom_ros_tools.transforms import Array
from motion_primitives.basis import DECAY, GaussianBasis, fitted
from motion_primitives.demonstration import Demonstration
from motion_primitives.dynamics import (
    Coupling,
    Execution,
    MotionState,
    PathExecution,
    QuinticPath,
    SpringDamper,
    integrated,
)
from motion_primitives.errors import DemonstrationError
from motion_primitives.primitive import Primitive, PrimitiveConfig, ViaPoint, check_shape, no_via_points
from motion_primitives.space import Space

QUADRATURE_POINTS = 4001
"""Number of points for numerical integration with Simpson's rule, see `DMP._rest_at_end`."""
MAX_DEVIATION_RAD = 0.95 * math.pi
"""Largest rotation from the path to a demonstrated orientation [rad]. Near pi, its direction is ambiguous."""


class DMPConfig(PrimitiveConfig):
    """Options of a discrete dynamic movement primitive."""

    bases: int = Field(30, ge=6, le=1000, description="Number of basis functions of each signal.")
    attractor: Literal["moving", "fixed"] = Field(
        "moving",
        description="Point to which the spring pulls. `moving`: the point moves from start to goal, and the motion "
        "arrives in time. `fixed`: the point is the goal, as in most publications, and the motion arrives some time "
        "after the duration.",
    )


class LearnedDMP(ConfigModel):
    """Learned data of a discrete dynamic movement primitive."""

    start: ListOf[float] = Field(description="Mean first point of the demonstrations.")
    goal: ListOf[float] = Field(description="Mean last point of the demonstrations.")
    duration_s: Seconds = Field(description="Mean duration of the demonstrations.")
    weights: ListOf[ListOf[float]] = Field(description="Weights of the basis functions, with one row for each signal.")


def pull(space: Space, spring: SpringDamper, start: Array, goal: Array, state: MotionState) -> Array:
    """Returns the acceleration of a spring-damper that pulls a motion to its goal, shape (dof,) [m/s^2 or rad/s^2].

    Positions follow Ijspeert 2013, equation 2.1; orientations follow Ude 2014, equation 16. At first, the pull is weak
    (Hoffmann 2009, equation 7), so that the acceleration does not jump at the start, even if the goal is not the
    demonstrated goal.

    Args:
        space: Space of the points.
        spring: The spring-damper.
        start: First point.
        goal: Last point.
        state: Current state of the motion.
    """
    phase = math.exp(-DECAY * state.time_s / spring.duration_s)
    distance = space.minus(goal, state.point) - phase * space.minus(goal, start)
    return np.asarray(spring.stiffness * distance - spring.damping * state.velocity)


class FixedGoalExecution(Execution):
    """A motion that is attracted by a fixed goal and shaped by a forcing term.

    Args:
        space: Space of the points.
        spring: The spring-damper, see `pull`.
        forcing: Function of the time since the start [s] that returns an acceleration, shape (dof,) [m/s^2 or rad/s^2].
        start: First point.
        goal: Last point.
        velocity: Velocity at the start, shape (dof,) [m/s or rad/s].
    """

    def __init__(
        self,
        space: Space,
        spring: SpringDamper,
        forcing: Callable[[float], Array],
        start: Array,
        goal: Array,
        velocity: Array,
    ) -> None:
        self.space, self.goal, self._spring, self._forcing, self._start = space, goal, spring, forcing, start
        self.state = MotionState(0.0, start, velocity)

    @property
    def end_s(self) -> float:
        """Planned duration [s]. The goal is reached some time after this duration."""
        return self._spring.duration_s

    def step(self, dt_s: float, couplings: Sequence[Coupling] = ()) -> MotionState:
        """Advances the motion by one time step, see `Execution`."""
        spring, goal = self._spring, self.goal
        assert goal is not None

        def acceleration(state: MotionState) -> Array:
            found = pull(self.space, spring, self._start, goal, state) + self._forcing(state.time_s)
            return sum((each(state, spring) for each in couplings), found)

        self.state = integrated(self.space, acceleration, self.state, dt_s)
        return self.state

    def set_goal(self, goal: ArrayLike) -> None:
        """Changes the goal, which makes the acceleration jump."""
        self.goal = self.space.point(goal, "goal")


class DMP(Primitive):
    """A discrete dynamic movement primitive, which keeps the demonstrated shape for every start and goal.

    The option `attractor` selects the equation of motion. With `moving`, the motion is a `PathExecution`. With `fixed`,
    the motion is a `FixedGoalExecution`, as in Ijspeert 2013 and Ude 2014. Positions and orientations share one phase.
    """

    Config = DMPConfig
    Learned = LearnedDMP

    def _learn(self, space: Space, demonstrations: Sequence[Demonstration]) -> None:
        basis = GaussianBasis.of(self.config.bases)
        is_moving = self.config.attractor == "moving"
        values = [basis.values(each.times / each.duration_s) for each in demonstrations]
        forces = [
            self._forces_beside_path(space, each, f"[{index}]") if is_moving else self._forces_to_goal(space, each)
            for index, each in enumerate(demonstrations)
        ]
        conditions = self._rest_at_end(basis) if is_moving else None
        self._weights = fitted(np.vstack(values), np.vstack(forces), conditions)
        self._basis = basis
        self._start = space.mean([each.points[0] for each in demonstrations])
        self._goal = space.mean([each.points[-1] for each in demonstrations])
        self._duration_s = float(np.mean([each.duration_s for each in demonstrations]))

    def _forces_beside_path(self, space: Space, demonstration: Demonstration, name: str) -> Array:
        """Computes the forcing term at each of m samples, with the attractor `moving` and a duration of 1 s.

        Args:
            space: Space of the points.
            demonstration: The demonstration.
            name: Name of the demonstration in error messages.

        Returns:
            Accelerations, shape (m, dof).
        """
        points, progress = demonstration.points, demonstration.times / demonstration.duration_s
        path = QuinticPath(space, 1.0, points[0], points[-1], np.zeros(space.dof))
        shifts = np.array([space.minus(point, path.at(u)[0]) for u, point in zip(progress.tolist(), points)])
        angles = np.linalg.norm(shifts[:, len(space.names) :], axis=1)
        if angles.max() > MAX_DEVIATION_RAD:
            expected = f"at most {MAX_DEVIATION_RAD:.3g} rad off the shorter way from the first to the last one"
            got = f"{angles.max():.3g} rad at sample [{int(np.argmax(angles))}] of {name}; show the motion in parts"
            raise DemonstrationError("orientations", expected, got)
        rates = np.gradient(shifts, progress, axis=0)
        spring = SpringDamper(self.config.alpha, 1.0)
        return np.asarray(np.gradient(rates, progress, axis=0) + spring.stiffness * shifts + spring.damping * rates)

    def _forces_to_goal(self, space: Space, demonstration: Demonstration) -> Array:
        """Computes the forcing term at each of m samples, with the attractor `fixed` and a duration of 1 s.

        Returns:
            Accelerations, shape (m, dof).
        """
        points, progress = demonstration.points, demonstration.times / demonstration.duration_s
        rates = space.rates(progress, points)
        bends = np.gradient(rates, progress, axis=0)
        spring = SpringDamper(self.config.alpha, 1.0)
        states = map(MotionState, progress.tolist(), points, rates)
        return np.asarray(bends - [pull(space, spring, points[0], points[-1], state) for state in states])

    def _rest_at_end(self, basis: GaussianBasis) -> Array:
        """Returns four linear constraints on the weights, shape (4, k), see `fitted`.

        The constraints make the deviation from the path and its time derivative 0 at the end, and the forcing term 0 at
        start and end. The deviation is the response of a critically damped spring to the forcing term. So deviation and
        derivative at the end are integrals over the forcing term.
        """
        u = np.linspace(0.0, 1.0, QUADRATURE_POINTS)
        simpson = np.where(np.arange(len(u)) % 2, 4.0, 2.0)
        simpson[[0, -1]] = 1.0
        left, rate = 1.0 - u, 0.5 * self.config.alpha
        response = left * np.exp(-rate * left)
        its_rate = (1.0 - rate * left) * np.exp(-rate * left)
        values = basis.values(u)
        rows = np.array(
            [simpson @ (response[:, None] * values), simpson @ (its_rate[:, None] * values), *values[[0, -1]]]
        )
        return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))

    def _begin(
        self,
        start: Array | None,
        goal: Array | None,
        duration_s: float | None,
        via_points: Sequence[ViaPoint],
        velocity: Array,
    ) -> Execution:
        no_via_points(via_points)
        space = self.space
        start = self._start if start is None else start
        goal = self._goal if goal is None else goal
        duration = self._duration_s if duration_s is None else duration_s
        spring, is_moving = SpringDamper(self.config.alpha, duration), self.config.attractor == "moving"

        def forcing(time_s: float) -> Array:
            if is_moving and time_s >= duration:
                return np.zeros(space.dof)
            return np.asarray(self._weights @ self._basis.values(np.array(time_s / duration)) / duration**2)

        if is_moving:
            path = QuinticPath(space, duration, start, goal, velocity)
            return PathExecution(space, spring, path, forcing, goal)
        return FixedGoalExecution(space, spring, forcing, start, goal, velocity)

    def _learned(self) -> LearnedDMP:
        return LearnedDMP(
            start=self._start.tolist(),
            goal=self._goal.tolist(),
            duration_s=self._duration_s,
            weights=self._weights.tolist(),
        )

    def _restore(self, space: Space, learned: Any) -> None:
        self._start, self._goal = space.point(learned.start, "start"), space.point(learned.goal, "goal")
        self._weights = check_shape(learned.weights, {"signals": space.dof, "bases": self.config.bases}, "weights")
        self._duration_s, self._basis = learned.duration_s, GaussianBasis.of(self.config.bases)
