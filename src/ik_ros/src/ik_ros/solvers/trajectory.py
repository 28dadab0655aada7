"""The solver `trajectory`: finds a smooth joint trajectory through waypoints, within limits and clear of obstacles."""

from __future__ import annotations

import math
import random
import threading
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache, partial
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator
from scipy.spatial.transform import Rotation

from custom_ros_tools.errors import MissingDependency, UnknownNameError
from custom_ros_tools.schema import KeyedError, ListOf, NonNegative, Positive, Seconds
from ik_ros.chain.kdl import Goal
from ik_ros.chain.solver import refuse_mimics
from ik_ros.problem import IKProblem, IKSolution, SampledTrajectory, Waypoint
from ik_ros.shape import ShapeConfig
from robot_model.reach import ORIENTATION_TOLERANCE_RAD, POSITION_TOLERANCE_M, Residual

from .kdl import KdlConfig, KdlSolver

try:
    import casadi
except ImportError:
    raise MissingDependency("casadi", "./rpbi setup mpc") from None

from ik_ros.chain.symbolic import link_frames, sphere_distances
from ik_ros.chain.trajectory_program import Program, Spline

MAX_INTERVALS = 128
"""Largest number of intervals of a spline. If waypoints are less than two intervals apart, a spline can rarely pass
through all waypoints."""
MAX_WAYPOINTS = MAX_INTERVALS // 2
"""Largest number of waypoints of a problem."""
MAX_SAMPLES = 100_000
KEPT_PROGRAMS = 4
"""Largest number of compiled programs in the cache. Each combination of intervals and waypoints needs its own program.
"""
CHECKS = 10
"""Number of samples in each interval of a spline at which limits and clearance of the result are checked."""
AIM = 0.01
"""Fraction of the default tolerances that is allowed as an error at waypoints. The smoothest motion uses it fully."""
SPARE = 1e-6
"""Fraction by which speed and acceleration limits are reduced, as a margin for rounding errors."""


class TrajectoryConfig(KdlConfig):
    """Options of the solver `trajectory`.

    Attributes:
        duration_s: Duration of the motion for problems that have a target but no waypoints [s].
        intervals: Smallest number of polynomial pieces of each joint's spline.
        sample_s: Time between two samples of the returned trajectory [s].
        velocity_limits: Largest speed by joint name [rad/s or m/s]; the URDF's limits apply to other joints.
        acceleration_limits: Largest acceleration by joint name [rad/s^2 or m/s^2]; other joints are not limited.
        shapes: Spheres on links, and obstacles fixed in the base frame.
        clearance: Smallest distance between spheres and obstacles [m].
        attempts: Largest number of attempts. Each attempt starts from different joint positions at the waypoints.
    """

    duration_s: Seconds = 2.0
    intervals: Annotated[int, Field(ge=4, le=MAX_INTERVALS)] = 16
    sample_s: Seconds = 0.02
    velocity_limits: dict[str, Positive] = Field(default_factory=dict)
    acceleration_limits: dict[str, Positive] = Field(default_factory=dict)
    shapes: ListOf[ShapeConfig] = ()
    clearance: NonNegative = 0.0
    attempts: Annotated[int, Field(ge=1)] = 3

    @model_validator(mode="after")
    def _fits_the_chain(self) -> TrajectoryConfig:
        chain = self.chain
        refuse_mimics(self, "trajectory")
        for key in ("velocity_limits", "acceleration_limits"):
            for name in getattr(self, key):
                if name not in chain.joint_names:
                    raise KeyedError(key, str(UnknownNameError("joint", name, chain.joint_names)))
        links = [chain.base, *(joint.child for joint in chain.joints)]
        for i, shape in enumerate(self.shapes):
            if shape.link is not None and shape.link not in links:
                raise KeyedError(f"shapes[{i}].link", str(UnknownNameError("link of the chain", shape.link, links)))
            if shape.link is not None and shape.sphere is None:
                raise KeyedError(f"shapes[{i}]", "shapes on links must be spheres; several can approximate one link")
        return self


class TrajectorySolver(KdlSolver):
    """Finds the smoothest motion, from rest to rest, that passes through waypoints at given times.

    First, KDL finds joint positions at the waypoints. Then a nonlinear program computes a spline for each joint.
    """

    Config = TrajectoryConfig
    deterministic = True

    def __init__(self, config: TrajectoryConfig) -> None:
        super().__init__(config)
        self._config = config
        speeds = dict(zip(self.joint_names, self.velocity_limits)) | config.velocity_limits
        accelerations = dict.fromkeys(self.joint_names, math.inf) | config.acceleration_limits
        self._max_velocity, self._max_acceleration = np.array([*speeds.values()]), np.array([*accelerations.values()])
        self._compiled = lru_cache(KEPT_PROGRAMS)(partial(Program, self.description, config.shapes))
        self._program_lock = threading.Lock()
        q = casadi.SX.sym("q", len(self.joint_names))
        distances = sphere_distances(config.shapes, link_frames(self.description, q)) or [casadi.inf]
        self._distances = casadi.Function("distances", [q], [casadi.vertcat(*distances)])

    def solve(self, problem: IKProblem) -> IKSolution:
        """Searches for a trajectory through the problem's waypoints, or to the target if there are no waypoints.

        Raises:
            ValueError: If the problem has neither waypoints nor a target, has too many waypoints, or has waypoints
                whose times do not increase.
            UnknownNameError: If `problem.start` names a joint that the robot does not have.
        """
        waypoints = self._waypoints(problem)
        with self._lock:
            start = self._start(problem.start)
        with self._program_lock:
            nearest = self._nearest_m(np.array([start]))
        if nearest < self._config.clearance:
            message = f"at the start, a sphere is as near as {nearest * 1e3:.4g} mm to an obstacle"
            return IKSolution(False, message, self.joint_names, tuple(start))
        goals = [Goal(replace(problem, target=waypoint.pose)) for waypoint in waypoints]
        answers: list[IKSolution] = []
        for attempt in range(self._config.attempts):
            postures, failure = self._postures(problem, waypoints, start, attempt)
            answers.append(failure or self._shaped(problem, waypoints, goals, start, postures))
            if failure or answers[-1].success:
                break
        return answers[-1] if answers[-1].success else answers[0]

    def _waypoints(self, problem: IKProblem) -> tuple[Waypoint, ...]:
        """Checks and returns the waypoints of a problem, or the problem's target as the only waypoint."""
        waypoints = problem.waypoints
        if not waypoints:
            if problem.target is None:
                raise ValueError("waypoints: missing, and there is no target instead")
            waypoints = (Waypoint(self._config.duration_s, problem.target),)
        if len(waypoints) > MAX_WAYPOINTS:
            raise ValueError(f"waypoints: expected {MAX_WAYPOINTS} at most, got {len(waypoints)}")
        last_s = 0.0
        for i, waypoint in enumerate(waypoints):
            if not waypoint.time_s > last_s:
                raise ValueError(f"waypoints[{i}].time_s: must be after {last_s:g} s, got {waypoint.time_s:g}")
            last_s = waypoint.time_s
        if last_s / self._config.sample_s > MAX_SAMPLES:
            raise ValueError(f"waypoints: {last_s:g} s in steps of {self._config.sample_s:g} s (sample_s) are too many")
        return waypoints

    def _postures(
        self, problem: IKProblem, waypoints: Sequence[Waypoint], start: Sequence[float], attempt: int
    ) -> tuple[list[Sequence[float]], IKSolution | None]:
        """Finds joint positions for each waypoint. Each search begins at the positions for the previous waypoint.

        Args:
            problem: The problem.
            waypoints: The waypoints.
            start: n start positions [rad or m].
            attempt: Number of the attempt. From 1 on, the search for the first waypoint begins at random positions.

        Returns:
            The joint positions at the start and at each waypoint, and None. If a waypoint cannot be reached, the second
            value is the failed solution.
        """
        postures: list[Sequence[float]] = [start]
        if attempt:
            postures[0] = self.limits.random(random.Random(f"{problem.seed} {attempt}"), start)
        for waypoint in waypoints:
            near = dict(zip(self.joint_names, postures[-1]))
            found = super().solve(replace(problem, target=waypoint.pose, start=near, seed=problem.seed + attempt))
            if not found.success:
                message = f"waypoint at {waypoint.time_s:g} s: {found.message}"
                return postures, replace(found, message=message, alternatives=())
            postures.append(found.positions)
        return [start, *postures[1:]], None

    def _shaped(
        self,
        problem: IKProblem,
        waypoints: Sequence[Waypoint],
        goals: Sequence[Goal],
        start: Sequence[float],
        postures: Sequence[Sequence[float]],
    ) -> IKSolution:
        """Computes the trajectory. If requirements are violated, the returned solution names them instead.

        Args:
            problem: The problem.
            waypoints: The waypoints.
            goals: Target and tolerances of each waypoint.
            start: n start positions [rad or m].
            postures: Joint positions at the start and at the waypoints, as the initial guess.
        """
        times_s = np.array([0.0, *(waypoint.time_s for waypoint in waypoints)])
        duration_s = float(times_s[-1])
        with self._program_lock:
            program = self._program(times_s)
            spline = program.spline
            guess = np.stack([np.interp(spline.times, times_s / duration_s, each) for each in zip(*postures)], axis=1)
            tolerance = np.array((*problem.position_tolerance, *problem.rotation_tolerance))
            aim = AIM * np.array((POSITION_TOLERANCE_M,) * 3 + (ORIENTATION_TOLERANCE_RAD,) * 3)
            points, status = program.solve(
                start=np.array(start),
                poses=np.stack([_flat(waypoint) for waypoint in waypoints], axis=1),
                basis=spline.basis(times_s[1:] / duration_s),
                tolerance=np.where(np.array(goals[0].tolerance) < np.inf, tolerance + aim, np.inf),
                limits=self.limits,
                max_velocity=self._max_velocity * duration_s * (1.0 - SPARE),
                max_acceleration=self._max_acceleration * duration_s**2 * (1.0 - SPARE),
                clearance=self._config.clearance,
                guess=guess,
            )
            nearest = self._nearest_m(spline.basis(_checks(spline)) @ points)
        passed = spline.basis(times_s[1:] / duration_s) @ points
        with self._lock:
            residuals = [self.residual(goal, q.tolist()) for goal, q in zip(goals, passed)]
        problems = [
            f"the waypoint at {waypoint.time_s:g} s is missed by {_in_words(residual)}"
            for waypoint, residual in zip(waypoints, residuals)
            if residual.size > 1.0
        ]
        problems += self._too_fast(spline, points, duration_s)
        if nearest < self._config.clearance:
            problems.append(f"a sphere comes as near as {nearest * 1e3:.4g} mm to an obstacle")
        worst = max(residuals, key=lambda residual: residual.size)
        apart = f", {nearest * 1e3:.4g} mm at least from obstacles" if math.isfinite(nearest) else ""
        passes = f"passes {len(waypoints)} waypoints within {_in_words(worst)}{apart}"
        return IKSolution(
            success=not problems,
            message=f"{'; '.join(problems)} (Ipopt: {status})" if problems else passes,
            joint_names=self.joint_names,
            positions=tuple(points[-1].tolist()),
            position_error_m=max(residual.position_m for residual in residuals),
            orientation_error_rad=max(residual.orientation_rad for residual in residuals),
            trajectory=None if problems else self._sampled(spline, points, duration_s),
        )

    def _program(self, times_s: np.ndarray) -> Program:
        """Returns a program whose splines have enough intervals to pass through waypoints at m times [s].

        The first time is that of the start.
        """
        gap = float(np.diff(times_s).min() / times_s[-1])
        intervals = self._config.intervals
        while gap * intervals < 2.0 and intervals < MAX_INTERVALS:
            intervals *= 2
        return self._compiled(intervals, len(times_s) - 1)

    def _nearest_m(self, q: np.ndarray) -> float:
        """Returns the smallest distance between spheres and obstacles in k configurations [m].

        Args:
            q: n joint positions for each of the k configurations, k x n [rad or m].
        """
        return float(np.array(self._distances.map(len(q))(q.T)).min())

    def _too_fast(self, spline: Spline, points: np.ndarray, duration_s: float) -> list[str]:
        """Checks speeds and accelerations at many times of the trajectory.

        Returns one message for the largest violation of a speed limit, and one for the largest violation of an
        acceleration limit. Without violations, the list is empty.
        """
        problems = []
        for order, most, per in ((1, self._max_velocity, "s"), (2, self._max_acceleration, "s^2")):
            values = np.abs(spline.basis(_checks(spline), order) @ points).max(axis=0) / duration_s**order
            i = int((values / most).argmax())
            if values[i] > most[i]:
                unit = "rad" if self.limits.is_revolute[i] else "m"
                needs = f"needs {values[i]:.4g} {unit}/{per}, its limit is {most[i]:.4g}"
                problems.append(f"'{self.joint_names[i]}' {needs}")
        return problems

    def _sampled(self, spline: Spline, points: np.ndarray, duration_s: float) -> SampledTrajectory:
        times = np.linspace(0.0, 1.0, max(1, math.ceil(duration_s / self._config.sample_s)) + 1)
        positions, velocities = spline.basis(times) @ points, spline.basis(times, 1) @ points / duration_s
        return SampledTrajectory(
            times_s=tuple((times * duration_s).tolist()),
            positions=tuple(map(tuple, np.clip(positions, self.lower, self.upper).tolist())),
            velocities=tuple(map(tuple, velocities.tolist())),
        )


def _flat(waypoint: Waypoint) -> np.ndarray:
    """Returns a waypoint's pose as 12 numbers: the rotation matrix, column by column, and the position [m]."""
    position, quat_xyzw = waypoint.pose
    return np.concatenate((Rotation.from_quat(quat_xyzw).as_matrix().T.ravel(), position))


def _checks(spline: Spline) -> np.ndarray:
    return np.linspace(0.0, 1.0, CHECKS * spline.intervals + 1)


def _in_words(residual: Residual) -> str:
    return f"{residual.position_m * 1e3:.3g} mm and {residual.orientation_rad:.3g} rad"
