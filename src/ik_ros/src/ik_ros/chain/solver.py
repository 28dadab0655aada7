"""The common part of solvers of one link's pose."""

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
    """Options of every solver of one link's pose.

    Attributes:
        urdf_filename: The robot; `{package}/path` and `package://` are resolved.
        base_link: The link that targets are expressed in; above the tip.
        tip_link: The link that is moved to the target.
    """

    urdf_filename: ExistingFile
    base_link: Text
    tip_link: Text

    @cached_property
    def chain(self) -> Chain:
        """The chain between the links."""
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
    """Brings the tip of a chain of joints to a target.

    Thread-safe by a lock. A subclass only searches for positions. This class brings them into limits and checks them by
    forward kinematics, so a reported success is always true.

    Attributes:
        description: The chain in the URDF.
        chain: Its kinematics.
        limits: Limits of its joints.
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
        """Sets the limits of the n joints."""
        self.limits, self.lower, self.upper = limits, limits.lower, limits.upper
        self._start_limits = StartLimits(self.joint_names, limits)

    @abstractmethod
    def find(self, problem: IKProblem, goal: Goal, start: list[float]) -> Sequence[Sequence[float]]:
        """Searches for joint positions.

        Args:
            problem: The problem.
            goal: Its target with tolerances.
            start: n positions within limits [rad or m].

        Returns:
            Solutions with n positions each, the best first; empty if none was found.
        """

    def solve(self, problem: IKProblem) -> IKSolution:
        """Searches for joint positions that bring the tip to the target.

        Raises:
            ValueError: If the problem has no target, or a requirement that the solver does not support.
            UnknownNameError: If the robot has no joint of a name in `start`.
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
        """Returns the error of the tip in excess of the tolerances at n positions [rad or m]."""
        return goal.residual(self.chain.frame(q))

    def is_beyond_reach(self, problem: IKProblem) -> bool:
        """Returns whether the target is beyond the reach of the chain."""
        if problem.target is None:
            return False
        return not self.description.reach.covers(problem.target.position, math.hypot(*problem.position_tolerance))

    def _start(self, given: Mapping[str, float]) -> list[float]:
        """Returns n positions within limits [rad or m]."""
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
    """Refuses chains with joints that mimic others.

    Raises:
        ConfigError: If there are some; it names them.
    """
    if mimics := config.chain.mimics:
        message = f"{', '.join(mimics)}: '{solver}' cannot solve for joints that mimic others; 'kdl' can"
        raise ConfigError([Problem(config.urdf_filename, "", message)])


_COUNTS_AS_REACHED = {"position_tolerance": POSITION_TOLERANCE_M, "rotation_tolerance": ORIENTATION_TOLERANCE_RAD}


def large_tolerances(problem: IKProblem) -> list[str]:
    """Returns the tolerances, by field, that exceed the tolerance of success."""
    return [name for name, most in _COUNTS_AS_REACHED.items() if max(getattr(problem, name)) > most]


def refuse_boxes(problem: IKProblem, solver: str, may_turn: bool = False) -> None:
    """Refuses tolerances that exceed the tolerance of success; `may_turn` allows those for rotations.

    Raises:
        ValueError: If there are some; it names the field.
    """
    for name in large_tolerances(problem):
        if not (may_turn and name == "rotation_tolerance"):
            message = f"{name}: '{solver}' takes none above {_COUNTS_AS_REACHED[name]:g}, got {getattr(problem, name)}"
            raise ValueError(f"{message}; the solver 'kdl' makes use of them")
