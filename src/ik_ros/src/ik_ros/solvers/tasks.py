"""The solver `tasks`: minimises weighted costs subject to constraints by sequential quadratic programming."""

import random
import threading
from collections.abc import Iterator, Sequence

import numpy as np

from custom_ros_tools.errors import MissingDependency, UnknownNameError
from custom_ros_tools.schema import KeyedError
from ik_ros.problem import IKProblem, IKSolution
from ik_ros.solver import Solver, StartLimits
from robot_model.reach import Residual

try:
    import daqp  # noqa: F401
    import pinocchio  # noqa: F401
except ImportError as error:
    raise MissingDependency(error.name or "pinocchio", "./rpbi setup ik") from None

from ik_ros.tasks.formulation import Formulation, TaskSet
from ik_ros.tasks.frame_task import FrameTask
from ik_ros.tasks.gauss_newton import Candidate, GaussNewton, Iterate
from ik_ros.tasks.robot import from_base, to_se3

AIM = 0.1
"""Fraction of the tolerances that errors must not exceed when the search ends."""
PATIENCE, PATIENCE_OF_MANY = 5, 25
"""Number of iterations within which the largest violation has to halve to avoid a restart of the search. `PATIENCE`
applies to a single task, `PATIENCE_OF_MANY` to several tasks, which may conflict at first."""
SETTLED = 1e-2
"""If costs decrease by less than this fraction within `PATIENCE` iterations, they count as minimal."""
STANDSTILL = 1e-6
"""Step size below which the search from one start ends [rad or m]."""
NEAR_RANGE = 0.5
"""Standard deviation of Gaussian random starts around the given start [rad or m]. With a floating base, every second
random start is Gaussian; all other random starts are uniformly distributed within the limits."""


class TasksSolver(Solver):
    """Finds joint positions that minimise the user's costs subject to the user's constraints.

    A lock makes the solver thread-safe.

    Attributes:
        tasks: The robot and the tasks.
    """

    Config = Formulation
    deterministic = True

    def __init__(self, config: Formulation) -> None:
        self._config = config
        self.tasks = TaskSet(config)
        robot = self.tasks.robot
        self.joint_names = robot.joint_names
        self.lower, self.upper = tuple(robot.lower.tolist()), tuple(robot.upper.tolist())
        self.velocity_limits = tuple(robot.max_velocity.tolist())
        self.base_frame = self.tasks.base_frame
        self._gauss_newton = GaussNewton(robot, list(self.tasks.parts.values()))
        self._required = [
            (i, name, part.task) for i, (name, part) in enumerate(self.tasks.parts.items()) if part.is_required
        ]
        self._has_wishes = len(self._required) < len(self.tasks.parts)
        self._patience = PATIENCE if len(self.tasks.parts) == 1 else PATIENCE_OF_MANY
        self._lock = threading.Lock()
        self._start_limits = StartLimits(robot.joint_names, robot.limits)

    def solve(self, problem: IKProblem) -> IKSolution:
        """Searches for joint positions that minimise the costs and satisfy the constraints.

        Raises:
            ValueError: If a goal is missing or invalid, or a previous solution lacks a joint that a task needs. Also if
                the problem has a target, but the formulation does not have a main task.
            UnknownNameError: If the problem names an unknown joint or task.
        """
        with self._lock:
            start = self._start(problem)
            self._begin(problem, start)
            found = self._search(problem, start)
        robot = self.tasks.robot
        return IKSolution(
            success=found.size <= 1.0,
            message=self._in_words(found),
            joint_names=self.joint_names,
            positions=tuple(robot.positions(found.q).tolist()),
            position_error_m=max((residual.position_m for residual in found.residuals.values()), default=0.0),
            orientation_error_rad=max((residual.orientation_rad for residual in found.residuals.values()), default=0.0),
            base_pose=from_base(found.q) if robot.is_floating else None,
        )

    def _start(self, problem: IKProblem) -> np.ndarray:
        """Returns the configuration where the search starts, moved into the joint limits."""
        robot = self.tasks.robot
        q = robot.configuration({**self._config.start, **problem.start})
        return robot.with_positions(q, self._start_limits.wrap_to_limits(robot.positions(q).tolist()))

    def _begin(self, problem: IKProblem, start: np.ndarray) -> None:
        """Prepares all tasks and the Gauss-Newton search for a problem that starts at the configuration `start`."""
        for solution in problem.previous:
            self.tasks.robot.moving(solution)
        for name in problem.goals:
            if name not in self.tasks.parts:
                raise UnknownNameError("task", name, self.tasks.parts)
        main = self.tasks.main
        if problem.target is not None and main is None:
            raise ValueError("target: the formulation has no main task that could use it")
        for name, part in self.tasks.parts.items():
            is_target = name == main and problem.target is not None
            try:
                if isinstance(part.task, FrameTask) and is_target:
                    part.task.aim(problem)
                else:
                    part.task.begin(problem, problem.goals.get(name), start)
            except KeyedError as error:
                raise ValueError(f"{error.key}: {error.message}") from None
            except ValueError as error:
                key = "target" if name == main else f"goals: {name}"
                raise ValueError(f"{key}: {error}") from None
        self._gauss_newton.begin()

    def _search(self, problem: IKProblem, start: np.ndarray) -> Candidate:
        """Searches from several starts until a solution is found; returns the best candidate."""
        candidates = []
        for first in self._starts(problem, start):
            candidates.append(self._from(self._on_anchor(first)))
            if candidates[-1].size <= 1.0:
                break
        return min(candidates, key=lambda candidate: candidate.rank)

    def _starts(self, problem: IKProblem, start: np.ndarray) -> Iterator[np.ndarray]:
        yield start
        robot = self.tasks.robot
        generator = random.Random(problem.seed)
        reference = robot.positions(start).tolist()
        for i in range(self._config.restarts):
            if robot.is_floating and i % 2 == 0:
                positions = robot.limits.clip([generator.gauss(position, NEAR_RANGE) for position in reference])
            else:
                positions = robot.limits.random(generator, reference)
            yield robot.with_positions(start, positions)

    def _on_anchor(self, q: np.ndarray) -> np.ndarray:
        """Returns a configuration with the floating base moved so that the first pose constraint's link is at its goal.

        Without a pose constraint, the base gets the pose in the options. A fixed base does not change.
        """
        robot, anchor = self.tasks.robot, self.tasks.anchor
        if not robot.is_floating:
            return q
        q = robot.with_base(q, to_se3(self._config.base_start))
        if anchor is None:
            return q
        robot.update(q)
        return robot.with_base(q, anchor.goal * robot.frame(anchor.link_id).inverse() * to_se3(self._config.base_start))

    def _from(self, first: np.ndarray) -> Candidate:
        """Searches from one start configuration, and returns the best candidate."""
        candidates: list[Candidate] = []
        merits: list[float] = []
        for tried in self._gauss_newton(first):
            candidates.append(self._judged(tried))
            merits.append(tried.merit)
            if self._is_at_its_end(candidates, merits, tried.step):
                break
        best = min(range(len(candidates)), key=lambda i: (candidates[i].rank, merits[i], -i))  # the last of equals
        return candidates[best]

    def _is_at_its_end(self, candidates: Sequence[Candidate], merits: Sequence[float], step: float) -> bool:
        """Returns True if the search from one start has converged, has stalled or has used up its iterations."""
        count, size = len(candidates), candidates[-1].size
        if step < STANDSTILL or count > self._config.iterations or (size <= AIM and not self._has_wishes):
            return True
        if size <= 1.0 and self._has_wishes:
            return count > PATIENCE and merits[-1] > (1.0 - SETTLED) * merits[-1 - PATIENCE]
        return count > self._patience and size > 0.5 * candidates[-1 - self._patience].size

    def _judged(self, tried: Iterate) -> Candidate:
        residuals = {name: task.residual(tried.beyond[i]) for i, name, task in self._required}
        sizes = {name: task.size(residuals[name]) for _, name, task in self._required}
        hard = (size for name, size in sizes.items() if self.tasks.parts[name].is_hard)
        return Candidate(tried.q, residuals, max(sizes.values(), default=0.0), max(hard, default=0.0))

    def _in_words(self, found: Candidate) -> str:
        missed = [
            f"'{name}' is off by {_amount(found.residuals[name])}"
            for _, name, task in self._required
            if task.size(found.residuals[name]) > 1.0
        ]
        if missed:
            return "; ".join(missed)
        if not self._required:
            return "costs are minimal; none of them is required"
        largest = max(self._required, key=lambda one: one[2].size(found.residuals[one[1]]))[1]
        return f"all that is required is met, '{largest}' within {_amount(found.residuals[largest])}"


def _amount(residual: Residual) -> str:
    parts = [f"{residual.position_m * 1e3:.4g} mm"] if residual.position_m else []
    parts += [f"{residual.orientation_rad:.3g} rad"] if residual.orientation_rad or not parts else []
    return " and ".join(parts)
