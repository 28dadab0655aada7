"""What every solver of inverse kinematics is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from custom_ros_tools.schema import ConfigModel

from .problem import IKProblem, IKSolution


class Solver(ABC):
    """Solves problems of inverse kinematics for one robot.

    A subclass is told by its `Config`, in YAML or as parameters of the solver's node. What cannot be solved is an
    answer (`success` is false, and `message` says why); an exception means that the question makes no sense.

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
        """Looks for joint positions.

        Raises:
            ValueError: If the problem does not fit the solver: it lacks what is needed or asks for what this solver
                cannot do.
            UnknownNameError: If it names a joint or task that is not known.
        """
