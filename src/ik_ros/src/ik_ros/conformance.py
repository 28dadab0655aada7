"""Pytest tests that every solver must pass; derive a class from `SolverConformance` to test your own solver."""

import math
import os
import pickle
import random
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, ClassVar

import pytest

from custom_ros_tools.errors import UnknownNameError
from robot_model.geometry import Pose, Quaternion, angle_between, normalized
from robot_model.limits import Limits
from robot_model.model import RobotModel
from robot_model.reach import ORIENTATION_TOLERANCE_RAD, POSITION_TOLERANCE_M

from .problem import IKProblem, IKSolution
from .solver import Solver
from .solvers import SOLVERS

PROBLEMS = "IK_CONFORMANCE_PROBLEMS"
"""Name of the environment variable that overrides the number `random_problems`."""
_IN_ANOTHER_PROCESS = """
import pickle, sys
from ik_ros.lookup import make_solver
name, options, problems = pickle.load(sys.stdin.buffer)
solver = make_solver(name, options)
pickle.dump([solver.solve(problem) for problem in problems], open(sys.argv[1], "wb"))
"""


class SolverConformance:
    """Tests for solvers that bring one link to a target pose.

    A subclass sets `solver_name` and `options`, and may override the methods from `make` to `positions`.

    Attributes:
        solver_name: Argument of `make_solver`: a name in the table of solvers, or `"their_package.module:Class"`.
        options: Options of the solver. `forward` needs the keys `urdf_filename`, `base_link` and `tip_link`.
        least_share: Smallest fraction of reachable problems that the solver must solve.
        reachable_problems: Number of reachable problems.
        random_problems: Number of problems whose targets may be unreachable. Solutions may have `success=False`.
        reach_m: Largest absolute coordinate of random target positions in the base frame [m].
    """

    solver_name: ClassVar[str]
    options: ClassVar[Mapping[str, Any]]
    least_share: ClassVar[float] = 0.99
    reachable_problems: ClassVar[int] = 100
    random_problems: ClassVar[int] = 500
    reach_m: ClassVar[float] = 1.5

    # --- Methods that a subclass may override

    def make(self) -> Solver:
        """Makes a new solver."""
        return SOLVERS.make(self.solver_name, self.options)

    def problem(self, target: Pose, start: Mapping[str, float], seed: int = 0) -> IKProblem:
        """Makes a problem from a target pose in the base frame, start positions by joint name, and a seed."""
        return IKProblem(target=target, start=start, seed=seed)

    def forward(self, positions: Sequence[float]) -> Pose:
        """Computes the pose of the tip in the base frame with `RobotModel`, independently of the solver."""
        at = dict(zip(self.solver.joint_names, positions))
        q = [at.get(name, 0.0) for name in self.robot.joint_names]
        return self.robot.pose(q, str(self.options["tip_link"]), str(self.options["base_link"]))

    def positions(self, generator: random.Random) -> list[float]:
        """Draws random positions of the solver's joints within their limits [rad or m]."""
        return self.limits.random(generator, self.limits.middle)

    # --- Helpers of the tests

    @cached_property
    def solver(self) -> Solver:
        """The solver that is tested."""
        return self.make()

    @cached_property
    def limits(self) -> Limits:
        """The solver's joint limits, for random positions; all joints are treated as revolute."""
        return Limits(self.solver.lower, self.solver.upper, [True] * len(self.solver.joint_names))

    @cached_property
    def robot(self) -> RobotModel:
        """The robot, read from its URDF."""
        return RobotModel(str(self.options["urdf_filename"]))

    def start_at(self, positions: Sequence[float]) -> dict[str, float]:
        """Converts positions in the solver's joint order to a dict of positions by joint name [rad or m]."""
        return dict(zip(self.solver.joint_names, positions))

    def reachable(self, generator: random.Random, count: int) -> list[IKProblem]:
        """Makes `count` problems with reachable targets and random starts."""
        return [
            self.problem(self.forward(self.positions(generator)), self.start_at(self.positions(generator)))
            for _ in range(count)
        ]

    def checked(self, problem: IKProblem) -> IKSolution:
        """Solves a problem, checks the solution, and returns the solution.

        Checks joint order and number, that positions are finite and within the limits, and that there is a message. If
        the solution claims success, also checks that the tip reaches the target.
        """
        solution = self.solver.solve(problem)
        assert solution.joint_names == self.solver.joint_names, "joints are in another order"
        assert len(solution.positions) == len(self.solver.joint_names), solution
        for positions in (solution.positions, *solution.alternatives):
            assert all(map(math.isfinite, positions)), f"not finite: {solution}"
            for position, lower, upper in zip(positions, self.solver.lower, self.solver.upper):
                assert lower <= position <= upper, f"outside limits: {solution}"
        assert math.isfinite(solution.position_error_m + solution.orientation_error_rad), solution
        assert solution.message, "no message about the result"
        for positions in (solution.positions, *solution.alternatives) if solution.success else ():
            assert problem.target is not None
            distance, angle = distances(self.forward(positions), problem.target)
            assert distance <= 1.01 * POSITION_TOLERANCE_M, f"reported as solved, but off by {distance:g} m"
            assert angle <= 1.01 * ORIENTATION_TOLERANCE_RAD, f"reported as solved, but off by {angle:g} rad"
        return solution

    # --- The tests.

    def test_its_joints_and_limits_belong_together(self) -> None:
        """Joint names are unique. Lower limits do not exceed upper limits, and velocity limits are positive."""
        names, lower, upper = self.solver.joint_names, self.solver.lower, self.solver.upper
        assert names and len(set(names)) == len(names) == len(lower) == len(upper)
        assert all(low <= high for low, high in zip(lower, upper))
        assert len(self.solver.velocity_limits) == len(names)
        assert all(velocity > 0.0 for velocity in self.solver.velocity_limits)

    def test_reachable_targets_are_reached(self) -> None:
        """The tip reaches the target if success is reported, and at least `least_share` of the problems are solved."""
        problems = self.reachable(random.Random(1), self.reachable_problems)
        share = sum(self.checked(problem).success for problem in problems) / self.reachable_problems
        assert share >= self.least_share, f"only {share:.1%} of the reachable targets are reached"

    def test_unreachable_target_returns_the_best_pose_and_its_distance(self) -> None:
        """The solver returns `success=False` instead of raising an exception, and reports the true pose error."""
        start = self.start_at(self.limits.middle)
        target = Pose((0.0, 0.0, 100.0))
        solution = self.checked(self.problem(target, start))
        assert not solution.success
        distance, angle = distances(self.forward(solution.positions), target)
        assert abs(distance - solution.position_error_m) < 1e-3, (distance, solution)
        assert abs(angle - solution.orientation_error_rad) < 0.01, (angle, solution)

    def test_answers_to_random_problems_are_finite_and_within_limits(self) -> None:
        """Solutions are finite and within the limits, even for unreachable targets and starts outside the limits."""
        generator = random.Random(2)
        for seed in range(int(os.environ.get(PROBLEMS, self.random_problems))):
            x, y, z = (generator.uniform(-self.reach_m, self.reach_m) for _ in range(3))
            start = [position + generator.gauss(0.0, 2.0) for position in self.positions(generator)]
            self.checked(self.problem(Pose((x, y, z), random_quat(generator)), self.start_at(start), seed))

    def test_a_target_that_is_not_finite_is_refused(self) -> None:
        """A target with a non-finite number raises a ValueError, usually from the constructor of `IKProblem`."""
        for bad in (math.nan, math.inf, 1e300):
            for target in (Pose((0.1, bad, 0.3)), Pose((0.1, 0.2, 0.3), (0.0, 0.0, bad, 1.0))):
                with pytest.raises(ValueError, match="finite"):
                    self.solver.solve(self.problem(target, {}))

    def test_unknown_joint_is_refused_naming_the_known_ones(self) -> None:
        """An unknown joint name in the start raises an error, so that a misspelt name is not silently ignored."""
        problem = self.problem(self.forward(self.limits.middle), {"no_such_joint": 0.0})
        with pytest.raises(UnknownNameError, match=f"no_such_joint.*{self.solver.joint_names[0]}"):
            self.solver.solve(problem)

    def test_equal_problems_have_equal_answers(self) -> None:
        """Solutions do not depend on earlier problems, the solver object, the process, or the number of threads."""
        if not self.solver.deterministic:
            pytest.skip(f"'{self.solver_name}' is not declared deterministic")
        problems = self.reachable(random.Random(3), 10) + [self.problem(Pose((0.0, 0.0, 100.0)), {})]
        first = [self.solver.solve(problem) for problem in problems]
        assert [self.solver.solve(problem) for problem in reversed(problems)] == first[::-1], (
            "answers depend on earlier problems"
        )
        fresh = self.make()
        assert [fresh.solve(problem) for problem in problems] == first, "another solver object answers differently"
        assert self._in_another_process(problems) == first, "another process answers differently"

    def _in_another_process(self, problems: Sequence[IKProblem]) -> Any:
        threads = "2" if os.environ.get("OPENBLAS_NUM_THREADS") == "1" else "1"  # another number of threads than here
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "OPENBLAS_NUM_THREADS": threads}
        with tempfile.NamedTemporaryFile() as answers:
            asked = pickle.dumps((self.solver_name, self.options, list(problems)))
            command = [sys.executable, "-c", _IN_ANOTHER_PROCESS, answers.name]
            subprocess.run(command, input=asked, env=environment, check=True, timeout=120.0)
            return pickle.loads(answers.read())


def distances(pose: Pose, other: Pose) -> tuple[float, float]:
    """Returns the distance between two positions [m], and the angle between two orientations [rad]."""
    return math.dist(pose.position, other.position), angle_between(pose.quat_xyzw, other.quat_xyzw)


def random_quat(generator: random.Random) -> Quaternion:
    """Draws a uniformly distributed random rotation as a quaternion x, y, z, w."""
    return normalized([generator.gauss(0.0, 1.0) for _ in range(4)])
