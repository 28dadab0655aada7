"""Moves a target through waypoints. New waypoints may change the motion while the target moves."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robot_model.geometry import Pose
from rpbi.control.trajectories.trajectory import DesiredState, Knot, Trajectory

from .config import WaypointError, WaypointMotionConfig
from .limits import Excess, MotionLimitsConfig, Peaks
from .rotation import RotationKnot, RotationPath, angular_rates
from .waypoints import Array, Waypoints, estimated_rates

MAX_TRIES = 50
"""Largest number of iterations that slow a motion down to its limits."""
KEPT = 1.0 + 1e-9
"""Factor up to which a motion is not slowed down, to tolerate rounding errors."""
LEAST_STRETCH = 1.02
"""Smallest factor by which one iteration slows a motion down."""
ROUNDING_S = 1e-9
"""Time by which a sample may be in the future, to tolerate rounding errors [s]."""


class TargetSample(NamedTuple):
    """The target at one time.

    Attributes:
        time_s: Time of the sample [s].
        state: Values, velocities and accelerations of the waypoint rows that are interpolated as numbers.
        pose: Pose of the target frame; None for targets of joints.
    """

    time_s: float
    state: DesiredState
    pose: Pose | None


class Plan(NamedTuple):
    """A planned motion.

    Attributes:
        scalars: Trajectory of the waypoint rows that are interpolated as numbers.
        path: Path of the orientation; None if the orientation is constant or interpolated as numbers.
        knots_s: Times of the waypoints [s].
    """

    scalars: Trajectory
    path: RotationPath | None
    knots_s: tuple[float, ...]

    def spliced(self, new: Plan, at_s: float) -> Plan:
        """Returns a plan that equals this plan until time `at_s` [s] and the plan `new` afterwards."""
        path = None if self.path is None or new.path is None else self.path.spliced(new.path, at_s)
        kept = tuple(time_s for time_s in self.knots_s if time_s <= at_s)
        return Plan(self.scalars.spliced(new.scalars, at_s), path, (*kept, *(t for t in new.knots_s if t > at_s)))

    def since(self, time_s: float) -> Plan:
        """Returns this plan without the waypoints before a time [s], and without the segments that end before it."""
        path = None if self.path is None else self.path.since(time_s)
        return Plan(self.scalars.since(time_s), path, tuple(each for each in self.knots_s if each >= time_s))


class Added(NamedTuple):
    """Result of planning a motion through new waypoints.

    Attributes:
        peaks: Largest speeds and accelerations of the new motion.
        stretch: Factor by which the motion was slowed down to keep the limits; 1 if the limits were kept anyway.
        excess: The limit that the motion exceeded most before it was slowed down.
    """

    peaks: Peaks
    stretch: float
    excess: Excess


class Interpolator:
    """Plans a motion through waypoints and returns samples of the motion. New waypoints may arrive at any time.

    Samples are `inter_dt` apart, starting at the first waypoint. The last sample is at the end of the motion. Without
    interpolation, the samples are the waypoints, and limits are ignored.

    New waypoints leave the next `nochange_window_length` samples unchanged. After these samples, the new motion begins
    with the old motion's position and velocity. New waypoints before the first changed sample are ignored.

    A motion that exceeds a limit is refused or slowed down. Slowing down multiplies the durations of all segments
    between waypoints by the same factor.

    All times passed to methods are in seconds on the same clock, which must not go backwards.

    Args:
        config: Description of the motion.
        limits: Limits that replace the limits in `config`; None to use the limits in `config`.

    Attributes:
        delay_s: Total duration of all completed pauses [s]. Plan time is clock time minus this duration.
    """

    def __init__(self, config: WaypointMotionConfig, limits: MotionLimitsConfig | None = None) -> None:
        self._dimensions, self._config = config.motion_dimensions, config.interpolation
        self._limits = limits or config.interpolation.limits
        self._plan: Plan | None = None
        self._grid_s = 0.0
        """Time of one point of the sample grid [s]."""
        self._sent_s = -math.inf
        """Time of the newest sample that was returned [s]."""
        self.delay_s = 0.0
        self._paused_s: float | None = None

    @property
    def plan(self) -> Plan | None:
        """The present plan; None before the first waypoints and after `forget`."""
        return self._plan

    def add(self, waypoints: Waypoints, now_s: float) -> Added:
        """Plans a motion through waypoints. The waypoints' times are on the same clock as `now_s` [s].

        Raises:
            WaypointError: If all waypoints are in the past, if all waypoints are before the first sample that may
                change, or if the motion cannot keep its limits. The old plan then remains in use.
        """
        lead_s = self._own_s(now_s) - now_s
        now_s += lead_s
        times_s = tuple(each + lead_s for each in waypoints.times_s)
        old = self._plan if self._sent_s > -math.inf else None
        if old is None:
            if times_s[-1] < now_s - ROUNDING_S:
                raise WaypointError(
                    f"data: expected a waypoint to come, the last one is {now_s - times_s[-1]:.6g} s old"
                )
            self._plan, added = self._within_limits(waypoints, times_s)
            self._grid_s = times_s[0]
            return added
        if self._sent_s >= old.scalars.end_s:  # at rest
            self._grid_s = now_s
        step_s, protected = self._config.inter_dt, self._config.nochange_window_length
        from_s = self._on_grid(now_s) + step_s * protected
        first = int(np.searchsorted(times_s, from_s + step_s - ROUNDING_S))
        if first == len(times_s):
            expected = f"expected a waypoint {from_s + step_s - now_s:.6g} s from now or later"
            got = f"the last one is {times_s[-1] - now_s:.6g} s from now"
            raise WaypointError(f"data: {expected}, after nochange_window_length, {protected}, and one sample; {got}")
        new, added = self._within_limits(waypoints, times_s, first, (from_s, old))
        self._plan = old.spliced(new, from_s).since(self._sent_s)
        return added

    def newest(self, now_s: float) -> TargetSample | None:
        """Returns the newest sample up to a time [s].

        Returns None if this sample does not exist or was already returned, or if the motion is paused.
        """
        plan = self._plan
        if plan is None or self._paused_s is not None:
            return None
        time_s = self._sample_time(plan, self._own_s(now_s))
        if time_s is None or time_s <= self._sent_s:
            return None
        self._sent_s = time_s
        return self._at(plan, time_s)

    def pause(self, now_s: float) -> None:
        """Pauses the motion."""
        if self._paused_s is None:
            self._paused_s = now_s

    def resume(self, now_s: float) -> None:
        """Continues the paused motion."""
        if self._paused_s is not None:
            self.delay_s += now_s - self._paused_s
            self._paused_s = None

    def forget(self) -> None:
        """Ends the motion. The next motion begins at its first waypoint, without a transition from the target."""
        self._plan, self._sent_s = None, -math.inf

    def _own_s(self, now_s: float) -> float:
        """Converts clock time [s] to plan time [s], which does not advance during pauses."""
        return (now_s if self._paused_s is None else self._paused_s) - self.delay_s

    def _on_grid(self, time_s: float) -> float:
        """Returns the last point of the sample grid up to a time [s]."""
        steps = math.floor((time_s - self._grid_s + ROUNDING_S) / self._config.inter_dt)
        return self._grid_s + steps * self._config.inter_dt

    def _sample_time(self, plan: Plan, now_s: float) -> float | None:
        """Returns the time of the newest sample up to `now_s` [s]; None before the first sample."""
        if not self._config.use_interpolation:
            return max((each for each in plan.knots_s if each <= now_s + ROUNDING_S), default=None)
        end_s, time_s = plan.scalars.end_s, self._on_grid(now_s)
        if now_s + ROUNDING_S >= end_s:
            return max(time_s, end_s) if self._config.hold else end_s
        return time_s if time_s >= plan.scalars.start_s else None

    def _at(self, plan: Plan, time_s: float) -> TargetSample:
        state = plan.scalars.sample(time_s)
        pose = None
        if self._dimensions.joint_names is None:
            quat = None if plan.path is None else plan.path.sample(time_s).quat_xyzw
            pose = self._dimensions.pose(state.position, quat)
        return TargetSample(time_s + self.delay_s, state, pose)

    def _within_limits(
        self,
        waypoints: Waypoints,
        times_s: tuple[float, ...],
        first: int = 0,
        after: tuple[float, Plan] | None = None,
    ) -> tuple[Plan, Added]:
        """Returns the plan from `_through`, slowed down to keep the limits, and the value that `add` returns.

        For the arguments, see `_through`.

        Raises:
            WaypointError: If the motion exceeds a limit, and slowing down is disabled or does not suffice.
        """
        start_s, stretch, asked = times_s[0] if after is None else after[0], 1.0, Excess()
        for _ in range(MAX_TRIES):
            slow_s = times_s if stretch == 1.0 else tuple(start_s + stretch * (each - start_s) for each in times_s)
            plan = self._through(waypoints.slower(stretch), slow_s, first, after)
            peaks = Peaks.of(plan.scalars, plan.path)
            excess = peaks.excess(self._limits) if self._config.use_interpolation else Excess()
            if stretch == 1.0:
                asked = excess
            if excess.stretch <= KEPT:
                return plan, Added(peaks, stretch, asked)
            if self._limits.exceeded == "refuse":
                raise WaypointError(f"interpolation.limits: expected a motion within the limits, got {asked.text}")
            stretch *= max(excess.stretch, LEAST_STRETCH)
        raise WaypointError(
            f"interpolation.limits: expected a motion that keeps the limits when it is slower, got {excess.text}, even "
            f"{stretch:.3g} times slower"
        )

    def _through(
        self,
        waypoints: Waypoints,
        times_s: tuple[float, ...],
        first: int = 0,
        after: tuple[float, Plan] | None = None,
    ) -> Plan:
        """Returns the plan through the waypoints from index `first` on.

        Args:
            waypoints: All waypoints.
            times_s: Times of all waypoints [s], which replace the times in `waypoints`.
            first: Index of the first waypoint to pass through.
            after: Time at which the new plan replaces the old plan [s], and the old plan. None: the new plan begins at
                the first waypoint.
        """
        method = self._config.method if self._config.use_interpolation else "linear"
        scalars = _scalar_knots(waypoints, times_s, method)[first:]
        path = _path_knots(waypoints, times_s, method)[first:]
        knots_s = times_s[first:]
        if after is None:
            return Plan(Trajectory.through(scalars), RotationPath.through(path) if path else None, knots_s)
        from_s, old = after
        if method == "linear":  # otherwise the velocity would jump at the first waypoint
            scalars[0] = scalars[0]._replace(velocity=Trajectory.through(scalars).sample(knots_s[0]).velocity)
            if path:
                path[0] = path[0]._replace(rate=RotationPath.through(path).sample(knots_s[0]).rate)
        if path and old.path is not None:
            path.insert(0, RotationKnot(from_s, *old.path.sample(from_s)))
        new = Trajectory.through([Knot(from_s, *old.scalars.sample(from_s)), *scalars])
        return Plan(new, RotationPath.through(path) if path else None, knots_s)


def _scalar_knots(waypoints: Waypoints, times_s: tuple[float, ...], method: str) -> list[Knot]:
    values = waypoints.scalars
    rates = accelerations = None
    if method != "linear":
        rates = estimated_rates(times_s, values) if waypoints.rates is None else waypoints.rates
    if method == "quintic" and rates is not None:
        accelerations = waypoints.accelerations
        if accelerations is None:
            accelerations = _estimated_accelerations(times_s, values, rates)

    def row(table: Array | None, i: int) -> tuple[float, ...] | None:
        return None if table is None else tuple(table[i].tolist())

    return [
        Knot(time_s, tuple(values[i].tolist()), row(rates, i), row(accelerations, i))
        for i, time_s in enumerate(times_s)
    ]


def _estimated_accelerations(times_s: tuple[float, ...], values: Array, rates: Array) -> Array:
    """Estimates accelerations at K points, shape (K, S).

    An inner point gets the mean of the accelerations of both adjacent cubic polynomials; the ends get zero.
    """
    accelerations = np.zeros_like(values)
    h = np.diff(times_s)[:, np.newaxis]
    slopes = np.diff(values, axis=0) / h
    at_start = (6.0 * slopes - 4.0 * rates[:-1] - 2.0 * rates[1:]) / h
    at_end = (-6.0 * slopes + 2.0 * rates[:-1] + 4.0 * rates[1:]) / h
    accelerations[1:-1] = 0.5 * (at_end[:-1] + at_start[1:])
    return accelerations


def _path_knots(waypoints: Waypoints, times_s: tuple[float, ...], method: str) -> list[RotationKnot]:
    quats = waypoints.quats_xyzw
    if quats is None:
        return []
    if method == "linear":
        return [RotationKnot(time_s, quat) for time_s, quat in zip(times_s, quats)]
    rates = angular_rates(times_s, quats)
    still = (0.0, 0.0, 0.0) if method == "quintic" else None
    return [RotationKnot(time_s, quat, rate, still) for time_s, quat, rate in zip(times_s, quats, rates)]
