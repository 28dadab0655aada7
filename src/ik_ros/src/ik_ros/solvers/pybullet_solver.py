"""The solver `pybullet`: the inverse kinematics of simulated robots in PyBullet, with restarts and joint limits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

from pydantic import model_validator

from custom_ros_tools.schema import Count, KeyedError, ListOf, NonNegative
from ik_ros.chain.kdl import Goal
from ik_ros.chain.solver import ChainConfig, ChainSolver, refuse_boxes, refuse_mimics
from ik_ros.problem import IKProblem
from robot_model.urdf.files import write_description
from rpbi.kinematics import Kinematics
from rpbi.kinematics.problem import PybulletProblem


class PybulletConfig(ChainConfig):
    """Options of the solver `pybullet`. Those that are not about the chain are explained in `PybulletProblem`.

    Each list has one value for each joint of the chain.
    """

    lowerLimits: ListOf[float] = ()
    upperLimits: ListOf[float] = ()
    jointRanges: ListOf[float] = ()
    resetPoses: ListOf[float] = ()
    jointDamping: ListOf[float] = ()
    solver: Literal[0, 1] = 0
    maxNumIterations: Count = 0
    residualThreshold: NonNegative = 0.0

    @model_validator(mode="after")
    def _options_fit_the_chain(self) -> PybulletConfig:
        try:
            PybulletProblem(self.tip_link, (0.0, 0.0, 0.0), **self.options).check_lengths(self.chain.joint_names)
        except ValueError as error:
            key, _, message = str(error).partition(": ")
            raise KeyedError(key, message) from None
        return self

    @property
    def options(self) -> dict[str, Any]:
        """The options that are passed to PyBullet with each problem."""
        return self.model_dump(exclude=set(ChainConfig.model_fields))


class PybulletSolver(ChainSolver):
    """Uses PyBullet's own inverse kinematics, see docs/ik.md; targets may have a free orientation.

    The random starts are the same for all seeds.

    Raises:
        ConfigError: If the chain has mimic joints; the message names these joints.
        ValueError: If a joint's ranges in the options and in the URDF do not overlap.
    """

    Config = PybulletConfig
    deterministic = True

    def __init__(self, config: PybulletConfig) -> None:
        super().__init__(config)
        refuse_mimics(config, "pybullet")
        self._options = config.options
        self._kinematics = Kinematics(write_description(self.description.urdf))
        question = PybulletProblem(config.tip_link, (0.0, 0.0, 0.0), **self._options)
        self.use_limits(question.narrowed(self._kinematics.limits, self.joint_names))

    def find(self, problem: IKProblem, goal: Goal, start: list[float]) -> Sequence[Sequence[float]]:
        """Returns the first solution, or the best positions if all searches fail. See `ChainSolver.find`.

        Raises:
            ValueError: If a tolerance of the problem is too large for this solver. Free orientations are allowed.
        """
        refuse_boxes(problem, "pybullet", goal.any_orientation)
        assert problem.target is not None
        quat_xyzw = () if goal.any_orientation else problem.target.quat_xyzw
        question = PybulletProblem(
            self.description.tip, problem.target.position, quat_xyzw, currentPosition=start, **self._options
        )
        return [self._kinematics.solve(question).positions]
