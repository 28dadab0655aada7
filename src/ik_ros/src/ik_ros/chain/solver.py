"""Base class of the solvers that bring one link to a target pose."""

from __future__ import annotations

import math
import threading
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import ClassVar

from pydantic import model_validator

from custom_ros_tools.errors import ConfigError, Problem, UnknownNameError
from custom_ros_tools.schema import ConfigModel, KeyedError, Text
from ik_ros.problem import IKProblem, IKSolution
from ik_ros.solver import Solver, StartLimits
from robot_model.asset_files import ExistingFile
from robot_model.chain import Chain
from robot_model.limits import Limits
from robot_model.reach import ORIENTATION_TOLERANCE_RAD, POSITION_TOLERANCE_M, Residual

from .kdl import Goal, KdlChain


class ChainConfig(ConfigModel):
    """Options of every solver that brings one link to a target pose.

    Attributes:
        urdf_filename: The robot's URDF; `{package}/path` and `package://` are resolved.
        base_link: Link in whose frame targets are expressed; an ancestor of the tip.
        tip_link: Link that is moved to the target.
    """

    urdf_filename: ExistingFile
    base_link: Text
    tip_link: Text

    @cached_property
    def chain(self) -> Chain:
        """The chain from `base_link` to `tip_link`."""
        return Chain(self.urdf_filename, self.base_link, self.tip_link)

    @model_validator(mode="after")
    def _chain_can_be_solved_for(self) -> ChainConfig:
        try:
            _ = self.chain
        except UnknownNameError as error:
            key = "base_link" if error.name == self.base_link else "tip_link"
            raise KeyedError(key, str(error)) from None
        except ValueError as error:
            raise KeyedError("tip_link", f"{self.urdf_filename}: {error}") from None
        return self


class ChainSolver(Solver):
    """Brings the tip of a chain of joints to a target pose.

    Subclasses only search for joint positions. This class moves the positions into the limits, and checks by forward
    kinematics that the tip reaches the target before it reports success. A lock makes `solve` thread-safe.

    Attributes:
        description: The chain, read from the URDF.
        chain: Kinematics of the chain.
        limits: Limits of the n joints.
    """

    Config: ClassVar[type[ChainConfig]] = ChainConfig

    def __init__(self, config: ChainConfig) -> None:
        self.description = config.chain
        self.chain = KdlChain(self.description)
        self.joint_names = self.description.joint_names
        self.base_frame = self.description.base
        self.velocity_limits = self.description.velocity_limits
        self.use_limits(self.description.limits)
        self._lock = threading.Lock()

    def use_limits(self, limits: Limits) -> None:
        """Replaces the limits of the n joints."""
        self.limits, self.lower, self.upper = limits, limits.lower, limits.upper
        self._start_limits = StartLimits(self.joint_names, limits)

    @abstractmethod
    def find(self, problem: IKProblem, goal: Goal, start: list[float]) -> Sequence[Sequence[float]]:
        """Searches for joint positions that bring the tip to the goal.

        Args:
            problem: The problem.
            goal: The problem's target with tolerances.
            start: Start of the search: n positions within the limits [rad or m].

        Returns:
            Solutions with n positions each, the best first. May be empty, or contain positions that miss the goal.
        """

    def solve(self, problem: IKProblem) -> IKSolution:
        """Searches for joint positions that bring the tip to the target.

        Raises:
            ValueError: If the problem lacks a target, or has a requirement that the solver does not support.
            UnknownNameError: If `problem.start` names a joint that the robot does not have.
        """
        with self._lock:
            goal = Goal(problem)
            start = self._start(problem.start)
            finite = (q for q in self.find(problem, goal, start) if all(map(math.isfinite, q)))
            found = [self.limits.wrap_to_limits(q, start)[0] for q in finite] or [start]
            residuals = [self.residual(goal, q) for q in found]
        return IKSolution(
            success=residuals[0].size <= 1.0,
            message=self._in_words(problem, goal, residuals[0]),
            joint_names=self.joint_names,
            positions=tuple(found[0]),
            position_error_m=residuals[0].position_m,
            orientation_error_rad=residuals[0].orientation_rad,
            alternatives=tuple(tuple(q) for q, residual in zip(found[1:], residuals[1:]) if residual.size <= 1.0),
        )

    def residual(self, goal: Goal, q: Sequence[float]) -> Residual:
        """Returns the part of the tip's error that exceeds the goal's tolerances, at n joint positions [rad or m]."""
        return goal.residual(self.chain.frame(q))

    def is_beyond_reach(self, problem: IKProblem) -> bool:
        """Returns whether the target's position is certainly unreachable (see `Reach`); False without a target."""
        if problem.target is None:
            return False
        return not self.description.reach.covers(problem.target.position, math.hypot(*problem.position_tolerance))

    def _start(self, given: Mapping[str, float]) -> list[float]:
        """Returns n start positions within the limits; for joints that are not given, the middle of their limits."""
        for name in given:
            if name not in self.description.robot_joints:
                raise UnknownNameError("joint", name, self.joint_names)
        middle = zip(self.joint_names, self.limits.middle)
        return self._start_limits.wrap_to_limits([given.get(name, position) for name, position in middle])

    def _in_words(self, problem: IKProblem, goal: Goal, residual: Residual) -> str:
        target = "its target" if goal.is_point else "the tolerances of its target"
        words = residual.in_words(self.description.tip, not goal.any_orientation, target)
        is_far = residual.size > 1.0 and self.is_beyond_reach(problem)
        return words + ("; it is beyond the reach of the chain" if is_far else "")


def refuse_mimics(config: ChainConfig, solver: str) -> None:
    """Checks that a chain has no mimic joints.

    Args:
        config: Options with the chain.
        solver: Name of the solver, for the error message.

    Raises:
        ConfigError: If the chain has mimic joints; the message names these joints.
    """
    if mimics := config.chain.mimics:
        message = f"{', '.join(mimics)}: '{solver}' cannot solve for joints that mimic others; 'kdl' can"
        raise ConfigError([Problem(config.urdf_filename, "", message)])


_COUNTS_AS_REACHED = {"position_tolerance": POSITION_TOLERANCE_M, "rotation_tolerance": ORIENTATION_TOLERANCE_RAD}


def large_tolerances(problem: IKProblem) -> list[str]:
    """Returns the names of a problem's tolerance fields that exceed the default tolerances (1 mm, 0.01 rad)."""
    return [name for name, most in _COUNTS_AS_REACHED.items() if max(getattr(problem, name)) > most]


def refuse_boxes(problem: IKProblem, solver: str, may_turn: bool = False) -> None:
    """Checks that the tolerances of a problem do not exceed the default tolerances (1 mm, 0.01 rad).

    Args:
        problem: The problem.
        solver: Name of the solver, for the error message.
        may_turn: Whether larger tolerances for rotations are allowed.

    Raises:
        ValueError: If a tolerance is larger; the message names the field.
    """
    for name in large_tolerances(problem):
        if not (may_turn and name == "rotation_tolerance"):
            message = f"{name}: '{solver}' takes none above {_COUNTS_AS_REACHED[name]:g}, got {getattr(problem, name)}"
            raise ValueError(f"{message}; the solver 'kdl' makes use of them")
