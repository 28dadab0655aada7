"""Forward and inverse kinematics of a robot, in a private PyBullet client."""

from .ik_problem import IKProblem
from .ik_solution import IKSolution
from .kinematics import Kinematics

__all__ = ["IKProblem", "IKSolution", "Kinematics"]
