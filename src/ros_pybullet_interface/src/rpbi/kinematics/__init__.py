"""Forward and inverse kinematics of a robot, in a private PyBullet client."""

from .kinematics import Kinematics
from .problem import IKProblem, IKSolution

__all__ = ["IKProblem", "IKSolution", "Kinematics"]
