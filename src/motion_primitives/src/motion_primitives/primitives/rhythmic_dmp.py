"""Rhythmic dynamic movement primitives."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field
from scipy.optimize import minimize_scalar

from custom_ros_tools.schema import ConfigModel, ListOf, Seconds, optional
from custom_ros_tools.transforms import Array
from motion_primitives.basis import PeriodicBasis, fitted
from motion_primitives.demonstration import Demonstration
from motion_primitives.dynamics import Coupling, Execution, MotionState, PathExecution, QuinticPath, SpringDamper
from motion_primitives.errors import DemonstrationError, PlanError
from motion_primitives.primitive import Primitive, PrimitiveConfig, ViaPoint, check_shape, no_via_points
from motion_primitives.space import Space

MIN_CORRELATION = 0.7
"""Smallest autocorrelation, at a lag of one period, at which a motion counts as periodic."""
MIN_CYCLES = 1.5
"""Smallest number of periods in a demonstration if the option `period_s` is not set."""
SETTLING_CYCLES, STEPS_PER_CYCLE = 2, 100
"""Number of periods until a motion has settled on its limit cycle, and number of integration steps per period."""


class RhythmicDMPConfig(PrimitiveConfig):
    """Options of a rhythmic dynamic movement primitive."""

    bases: int = Field(30, ge=6, le=1000, description="Number of basis functions of each signal.")
    period_s: Seconds | None = optional(
        "Period of the demonstrations. By default, computed from their autocorrelation."
    )


class LearnedRhythmicDMP(ConfigModel):
    """Learned data of a rhythmic dynamic movement primitive."""

    center: ListOf[float] = Field(description="Centre of the periodic motion.")
    start: ListOf[float] = Field(description="Difference from the centre at the start of the cycle.")
    start_rate: ListOf[float] = Field(
        description="Rate of change of the difference from the centre at the start of the cycle, per period."
    )
    period_s: Seconds = Field(description="Period of the demonstrations.")
    duration_s: Seconds = Field(description="Mean duration of the demonstrations.")
    weights: ListOf[ListOf[float]] = Field(description="Weights of the basis functions, with one row for each signal.")


class RhythmicExecution(PathExecution):
    """A rhythmic motion that ends after a given duration.

    Args:
        primitive: The primitive.
        center: Centre of the motion.
        duration_s: Duration of the motion [s].

    Attributes:
        amplitude: Amplitude, as a multiple of the demonstrated amplitude. Callers may change the amplitude at any time.
        cycles: Number of periods since the start.
    """

    def __init__(self, primitive: RhythmicDMP, center: Array, duration_s: float) -> None:
        space, spring = primitive.space, SpringDamper(primitive.config.alpha, primitive.period_s)
        self._primitive, self._duration_s = primitive, duration_s
        self.amplitude, self.cycles, self._counted_s = primitive.amplitude, 0.0, 0.0
        path = QuinticPath(space, spring.duration_s, center, center, np.zeros(space.dof))
        super().__init__(space, spring, path, self._force, None)

    @property
    def end_s(self) -> float:
        """Duration of the motion [s]."""
        return self._duration_s

    @property
    def period_s(self) -> float:
        """Period of the motion [s]. Callers may change the period at any time."""
        return self.spring.duration_s

    @period_s.setter
    def period_s(self, period_s: float) -> None:
        self.spring = SpringDamper(self.spring.alpha, checked_period(period_s))

    def step(self, dt_s: float, couplings: Sequence[Coupling] = ()) -> MotionState:
        """Advances the motion by one time step, see `Execution`."""
        state = super().step(dt_s, couplings)
        self.cycles, self._counted_s = self._cycles_at(state.time_s), state.time_s
        return state

    def set_goal(self, goal: ArrayLike) -> None:
        """Moves the centre of the motion to `goal`.

        The centre arrives at the end of the first period, or a quarter of a period after the call, whichever is later.
        """
        super().set_goal(goal)
        self.goal = None

    def _cycles_at(self, time_s: float) -> float:
        return self.cycles + (time_s - self._counted_s) / self.period_s

    def _force(self, time_s: float) -> Array:
        return self.amplitude * self._primitive.forcing(self._cycles_at(time_s), self.period_s)


def checked_period(period_s: float) -> float:
    """Checks and returns a period [s].

    Raises:
        PlanError: If the period is not a finite number above 0.
    """
    if not 0.0 < period_s < math.inf:
        raise PlanError("period", "a finite time above 0 s", f"{period_s}")
    return float(period_s)


class RhythmicDMP(Primitive):
    """A rhythmic dynamic movement primitive, which repeats a periodic motion with any centre, period and amplitude.

    The motion is a limit cycle, see Ijspeert 2013, equations 2.7 to 2.9.

    Attributes:
        period_s: Period of motions that `begin` returns from now on [s]. `learn` sets the demonstrations' period.
        amplitude: Amplitude of motions that `begin` returns from now on, as a multiple of the demonstrated amplitude.
    """

    Config = RhythmicDMPConfig
    Learned = LearnedRhythmicDMP

    def __init__(self, config: Any = None) -> None:
        super().__init__(config)
        self.amplitude = 1.0

    @property
    def period_s(self) -> float:
        """Period of motions that `begin` returns from now on [s]."""
        return self._period_s

    @period_s.setter
    def period_s(self, period_s: float) -> None:
        self._period_s = checked_period(period_s)

    def forcing(self, cycles: float, period_s: float) -> Array:
        """Returns the forcing term for an amplitude of 1, shape (dof,) [m/s^2 or rad/s^2].

        Args:
            cycles: Number of periods since the start.
            period_s: Period of the motion [s].
        """
        return np.asarray(self._weights @ self._basis.values(np.array(cycles)) / period_s**2)

    def _learn(self, space: Space, demonstrations: Sequence[Demonstration]) -> None:
        centers = [space.mean(list(each.points)) for each in demonstrations]
        period_s = self.config.period_s or _period_of(space, demonstrations[0], centers[0])
        self._basis, spring = PeriodicBasis.of(self.config.bases), SpringDamper(self.config.alpha, period_s)
        values, forces, shifts = [], [], [0.0]
        for index, (each, center) in enumerate(zip(demonstrations, centers)):
            if each.duration_s < period_s:
                expected = f"at least a period of {period_s:.3g} s"
                raise DemonstrationError("demonstrations", expected, f"{each.duration_s:.3g} s in [{index}]")
            path = np.array([space.minus(point, center) for point in each.points])
            if index == 0:
                cycle = fitted(self._basis.values(each.times / period_s), path)
            else:
                shifts.append(_shift_of(self._basis, cycle, each.times / period_s, path))
            rates = np.gradient(path, each.times, axis=0)
            bends = np.gradient(rates, each.times, axis=0)
            forces.append(period_s**2 * (bends + spring.stiffness * path + spring.damping * rates))
            values.append(self._basis.values(each.times / period_s + shifts[index]))
        self._weights = fitted(np.vstack(values), np.vstack(forces))
        self._learned_center = space.mean(centers)
        self._period_s, self._learned_period_s = period_s, period_s
        self._duration_s = float(np.mean([each.duration_s for each in demonstrations]))
        self._find_start(space)

    def _find_start(self, space: Space) -> None:
        """Computes start and initial velocity of the limit cycle by integrating the motion until it has settled."""
        self._space = space
        settling = RhythmicExecution(self, self._learned_center, self._period_s)
        settling.amplitude = 1.0
        for _ in range(SETTLING_CYCLES * STEPS_PER_CYCLE):
            settling.step(self._period_s / STEPS_PER_CYCLE)
        self._start, self._start_rate = settling.deviation.point, self._period_s * settling.deviation.velocity

    def _begin(
        self,
        start: Array | None,
        goal: Array | None,
        duration_s: float | None,
        via_points: Sequence[ViaPoint],
        velocity: Array,
    ) -> Execution:
        no_via_points(via_points)
        center = self._learned_center if goal is None else goal
        execution = RhythmicExecution(self, center, self._duration_s if duration_s is None else duration_s)
        if start is None:
            execution.start_beside(self.amplitude * self._start, self.amplitude / self._period_s * self._start_rate)
        else:
            execution.start_at(start, velocity)
        return execution

    def _learned(self) -> LearnedRhythmicDMP:
        return LearnedRhythmicDMP(
            center=self._learned_center.tolist(),
            start=self._start.tolist(),
            start_rate=self._start_rate.tolist(),
            period_s=self._learned_period_s,
            duration_s=self._duration_s,
            weights=self._weights.tolist(),
        )

    def _restore(self, space: Space, learned: Any) -> None:
        self._learned_center = space.point(learned.center, "center")
        self._start = check_shape(learned.start, {"signals": space.dof}, "start")
        self._start_rate = check_shape(learned.start_rate, {"signals": space.dof}, "start_rate")
        self._weights = check_shape(learned.weights, {"signals": space.dof, "bases": self.config.bases}, "weights")
        self._period_s = self._learned_period_s = learned.period_s
        self._duration_s, self._basis = learned.duration_s, PeriodicBasis.of(self.config.bases)


def _period_of(space: Space, demonstration: Demonstration, center: Array) -> float:
    """Estimates the period of a demonstration [s] from the first peak of the autocorrelation, refined by a fit.

    Raises:
        DemonstrationError: If the demonstration is not periodic.
    """
    path = np.array([space.minus(point, center) for point in demonstration.points])
    duration_s, count = demonstration.duration_s, len(path)
    even = np.linspace(0.0, duration_s, count)
    signals = np.array([np.interp(even, demonstration.times, column) for column in path.T])
    lags = np.arange(1, int(count / MIN_CYCLES))
    power = [np.sum(signals[:, lag:] ** 2) * np.sum(signals[:, : count - lag] ** 2) for lag in lags]
    product = [np.sum(signals[:, lag:] * signals[:, : count - lag]) for lag in lags]
    correlation = np.array(product) / np.sqrt(np.maximum(power, 1e-300))
    is_peak = (correlation[1:-1] >= correlation[:-2]) & (correlation[1:-1] >= correlation[2:])
    peaks = np.flatnonzero(is_peak & (correlation[1:-1] > MIN_CORRELATION)) + 1
    if not len(peaks):
        expected = f"a motion that repeats, for at least {MIN_CYCLES:g} periods; or period_s"
        raise DemonstrationError("demonstrations", expected, f"none within {duration_s:.3g} s")
    first_s = float(lags[peaks[0]] * duration_s / (count - 1))
    basis = PeriodicBasis.of(12)

    def error(period_s: float) -> float:
        values = basis.values(demonstration.times / period_s)
        return float(np.sum((path - values @ fitted(values, path).T) ** 2))

    found = minimize_scalar(error, bounds=(0.95 * first_s, 1.05 * first_s), method="bounded")
    return float(found.x)


def _shift_of(basis: PeriodicBasis, cycle: Array, cycles: Array, path: Array) -> float:
    """Finds the phase shift with which a learned cycle best fits a demonstration.

    Args:
        basis: The basis functions.
        cycle: Weights of the learned cycle, shape (dof, k).
        cycles: m times of the demonstration, as numbers of periods since the demonstration's start.
        path: m deviations of the demonstration from its centre, shape (m, dof).

    Returns:
        Time to add to `cycles`, as a fraction of the period.
    """

    def error(shift: float) -> float:
        return float(np.sum((path - basis.values(cycles + shift) @ cycle.T) ** 2))

    coarse = min(np.linspace(0.0, 1.0, 36, endpoint=False), key=error)
    return float(minimize_scalar(error, bounds=(coarse - 0.03, coarse + 0.03), method="bounded").x)
