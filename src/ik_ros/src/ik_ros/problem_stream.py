"""Solves streams of problems, and limits the joint velocities between successive targets."""

import dataclasses
import time
from collections.abc import Sequence

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Positive

from .problem import IKProblem, IKSolution, JointPositions
from .solver import Solver


class JointRateLimiterConfig(ConfigModel):
    """Options of the joint velocity limits between successive targets."""

    max_velocity: Positive | dict[str, Positive] | None = Field(
        None,
        description="Velocity limit [rad/s or m/s]: one for all joints, or a mapping from joint names to limits. By "
        "default, the limits in the URDF.",
    )
    velocity_scale: float = Field(1.0, gt=0.0, le=1.0, description="Fraction of the velocity limits that is used.")
    max_period_s: Positive = Field(
        0.1,
        description="Largest time step between two targets [s]. After a longer pause, the next target moves only as "
        "far as in this time.",
    )
    hold: bool = Field(
        False,
        description="Whether targets continue to the last solution, and then stay there, while problems cannot be "
        "solved.",
    )


class JointRateLimiter:
    """Limits the joint velocities between successive targets.

    If a solution is too far from the last target, the next target is on the straight line from the last target to the
    solution in joint space. The joint that needs most time moves at its velocity limit, and all other joints move in
    proportion. So near a singularity or at a change of posture, the robot lags behind instead of jumping.

    Args:
        config: The configuration.
        joint_names: Names of the n joints.
        velocity_limits: Velocity limits of the n joints in the URDF [rad/s or m/s]; 0 and inf mean no limit.

    Attributes:
        hold: Whether targets continue towards the last solution while problems cannot be solved.
        max_period_s: Longest time between two targets that is taken into account [s].

    Raises:
        ValueError: If the configuration names an unknown joint, or a joint has a velocity limit neither in the
            configuration nor in the URDF.
    """

    def __init__(
        self, config: JointRateLimiterConfig, joint_names: Sequence[str], velocity_limits: Sequence[float]
    ) -> None:
        limits = dict(zip(joint_names, velocity_limits))
        given = config.max_velocity
        if isinstance(given, dict):
            if unknown := sorted(set(given) - set(limits)):
                known = ", ".join(joint_names)
                raise ValueError(f"continuity.max_velocity: no joint is called {', '.join(unknown)}; known are {known}")
            limits |= given
        elif given is not None:
            limits = dict.fromkeys(limits, given)
        if unlimited := ", ".join(name for name, limit in limits.items() if not 0.0 < limit < np.inf):
            raise ValueError(f"continuity.max_velocity: the URDF has no velocity for {unlimited}; give it one here")
        self.hold, self.max_period_s = config.hold, config.max_period_s
        self._limits = config.velocity_scale * np.array(list(limits.values()))
        self._last: np.ndarray | None = None

    def begin(self, positions: Sequence[float] | None) -> None:
        """Sets the last target to n positions [rad or m]. With None, the next target is the next solution."""
        self._last = None if positions is None else np.array(positions, dtype=float)

    def next(self, solution: Sequence[float], period_s: float) -> tuple[np.ndarray, float]:
        """Computes the next target.

        Args:
            solution: n positions to move to [rad or m].
            period_s: Time since the last target [s].

        Returns:
            The next target, n positions [rad or m], and the fraction of the way from the last target to the solution at
            which it lies; 1 means that the next target is the solution.
        """
        goal = np.array(solution, dtype=float)
        if self._last is None:
            self._last = goal
            return goal, 1.0
        way = goal - self._last
        needed_s = float(np.max(np.abs(way) / self._limits, initial=0.0))
        period_s = min(max(period_s, 0.0), self.max_period_s)
        share = 1.0 if needed_s <= period_s else period_s / needed_s
        self._last = goal if share == 1.0 else self._last + share * way
        return self._last, share


class ProblemStream:
    """Solves problems one after the other; each search starts at the last target.

    Args:
        solver: The solver.
        continuity: Limits the joint velocities between targets. None: the targets are the solutions.

    Attributes:
        target: n positions to command after the last problem [rad or m]; None if the problem did not lead to a target.
    """

    def __init__(self, solver: Solver, continuity: JointRateLimiter | None = None) -> None:
        self._solver = solver
        self._continuity = continuity
        self.target: tuple[float, ...] | None = None
        self._goal: tuple[float, ...] | None = None
        self._last: JointPositions = {}
        self._last_s: float | None = None

    def restart(self) -> None:
        """Deletes the last target, so that the next problem counts as the first problem."""
        self.target = self._goal = self._last_s = None
        self._last = {}
        if self._continuity is not None:
            self._continuity.begin(None)

    def solve(self, problem: IKProblem, stamp_s: float = 0.0) -> IKSolution:
        """Solves the next problem.

        Args:
            problem: The problem, with poses in the solver's base frame. Joints that `problem.start` leaves out start at
                the last target. With `continuity`, `problem.start` is only used for the first problem, and must contain
                all joints or be empty. In later problems, all joints start at the last target.
            stamp_s: Time of the problem [s]; 0 for now.

        Returns:
            The solution. With `continuity`, its positions are replaced by the target, except if it has a trajectory.

        Raises:
            UnknownNameError: If the problem names an unknown joint.
            ValueError: If the problem is invalid.
        """
        self.target, is_first = None, not self._last
        start: JointPositions = {**self._last, **problem.start}
        if self._continuity is not None:
            start = self._complete(problem.start) if is_first else self._last
        solution = self._solver.solve(dataclasses.replace(problem, start=start))
        if not solution.success:
            if self._continuity is not None and self._continuity.hold and self._goal is not None:
                self._advance(self._continuity, self._goal, stamp_s)
            return solution
        if self._continuity is None or solution.trajectory is not None:
            self._last = dict(zip(self._solver.joint_names, solution.positions))
            self.target = solution.positions if solution.trajectory is None else None
            return solution
        if is_first and start:
            positions = [start[name] for name in self._solver.joint_names]
            self._continuity.begin(np.clip(positions, self._solver.lower, self._solver.upper).tolist())
        self._goal = solution.positions
        target, share = self._advance(self._continuity, solution.positions, stamp_s)
        on_the_way = f"; the joints are {share:.0%} of the motion to it" if share < 1.0 else ""
        return dataclasses.replace(solution, positions=target, message=f"{solution.message}{on_the_way}")

    def _advance(
        self, continuity: JointRateLimiter, goal: tuple[float, ...], stamp_s: float
    ) -> tuple[tuple[float, ...], float]:
        """Moves the target towards a goal. Returns the new target, and the covered fraction of the way to the goal."""
        positions, share = continuity.next(goal, self._period_s(stamp_s))
        self.target = tuple(positions.tolist())
        self._last = dict(zip(self._solver.joint_names, self.target))
        return self.target, share

    def _complete(self, start: JointPositions) -> JointPositions:
        """Returns the start after checking that it has all joints or is empty.

        With an incomplete start, the robot would jump to guessed positions.
        """
        missing = [name for name in self._solver.joint_names if name not in start]
        if start and missing:
            raise ValueError(f"start: continuity begins there and needs all joints; it lacks {', '.join(missing)}")
        return start

    def _period_s(self, stamp_s: float) -> float:
        """Returns the time between the last stamp and `stamp_s` [s], or 0 at the first call; `stamp_s=0` means now."""
        now_s = stamp_s or time.monotonic()
        period_s = 0.0 if self._last_s is None else now_s - self._last_s
        self._last_s = now_s
        return period_s
