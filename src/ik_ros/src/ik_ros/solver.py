"""The interface of solvers of inverse kinematics."""

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

    The options of a subclass are its `Config`, in YAML or as parameters of the solver's node. A problem without
    solution is an answer (`success` is false, and `message` has the reason); an exception means that the problem is
    invalid.

    Attributes:
        Config: Model of its options.
        deterministic: Whether equal problems with equal seeds have equal answers, to the last bit.
        joint_names: The n joints that it finds positions for, always in the same order.
        lower: Their n lower limits [rad or m], -inf where there is none.
        upper: Their n upper limits [rad or m], inf where there is none.
        velocity_limits: Their n largest velocities by the URDF [rad/s or m/s], inf where there is none.
        base_frame: The link of the robot that poses of problems are expressed in.
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
        """Searches for joint positions.

        Raises:
            ValueError: If the problem does not fit the solver: a required field is missing, or the solver does not
                support a requirement.
            UnknownNameError: If it names a joint or task that is not known.
        """


class StartLimits:
    """Brings starts into limits; warns once of each joint, since a stream may repeat a start a hundred times a
    second."""

    def __init__(self, joint_names: Sequence[str], limits: Limits) -> None:
        self._joint_names = tuple(joint_names)
        self._limits = limits
        self._warned_of: set[str] = set()

    def wrap_to_limits(self, start: Sequence[float]) -> list[float]:
        """Returns n positions within limits [rad or m], for n positions [rad or m]."""
        inside = self._limits.wrap_to_limits(start, start)[0]
        joints = zip(self._joint_names, start, inside)
        outside = {name: asked for name, asked, used in joints if abs(asked - used) > LIMIT_ROUNDING}
        if not outside.keys() <= self._warned_of:
            positions = ", ".join(f"'{name}' {asked:g}" for name, asked in outside.items())
            _log.warning("the start is outside limits and is moved within them: %s", positions)
            self._warned_of |= outside.keys()
        return inside
