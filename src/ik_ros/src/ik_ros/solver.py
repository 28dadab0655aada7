"""Base class of the solvers of inverse kinematics."""

import logging
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

from custom_ros_tools.schema import ConfigModel
from robot_model.limits import LIMIT_ROUNDING, Limits

from .problem import IKProblem, IKSolution

_log = logging.getLogger(__name__)


class Solver(ABC):
    """Solves problems of inverse kinematics for one robot.

    A subclass declares its options in `Config`; users set the options in YAML, or as parameters of the solver's node.
    If a problem cannot be solved, the result has `success=False` and the reason in `message`. An exception means that
    the problem is invalid.

    Attributes:
        Config: Pydantic model of the options.
        deterministic: Whether equal problems with equal seeds have equal answers, to the last bit.
        joint_names: Names of the n joints that the solver finds positions for, always in the same order.
        lower: Lower limits of the n joints [rad or m]; -inf for joints without a lower limit.
        upper: Upper limits of the n joints [rad or m]; inf for joints without an upper limit.
        velocity_limits: Velocity limits of the n joints in the URDF [rad/s or m/s]; inf for joints without a limit.
        base_frame: Name of the frame in which the poses of problems are expressed, usually a link of the robot.
    """

    Config: ClassVar[type[ConfigModel]]
    deterministic: ClassVar[bool]
    joint_names: tuple[str, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    velocity_limits: tuple[float, ...]
    base_frame: str

    @abstractmethod
    def solve(self, problem: IKProblem) -> IKSolution:
        """Searches for joint positions that solve a problem.

        Raises:
            ValueError: If the problem does not fit the solver: a required field is missing, or the solver does not
                support a requirement.
            UnknownNameError: If the problem names an unknown joint or task.
        """


class StartLimits:
    """Moves start positions into the joint limits, and logs a warning once per joint.

    The warning is not repeated, since a stream of problems may have the same start a hundred times per second.
    """

    def __init__(self, joint_names: Sequence[str], limits: Limits) -> None:
        self._joint_names = tuple(joint_names)
        self._limits = limits
        self._warned_of: set[str] = set()

    def wrap_to_limits(self, start: Sequence[float]) -> list[float]:
        """Returns n start positions, moved into the limits [rad or m]; see `Limits.wrap_to_limits`."""
        inside = self._limits.wrap_to_limits(start, start)[0]
        joints = zip(self._joint_names, start, inside)
        outside = {name: asked for name, asked, used in joints if abs(asked - used) > LIMIT_ROUNDING}
        if not outside.keys() <= self._warned_of:
            positions = ", ".join(f"'{name}' {asked:g}" for name, asked in outside.items())
            _log.warning("the start is outside limits and is moved within them: %s", positions)
            self._warned_of |= outside.keys()
        return inside
