"""Forward and inverse kinematics of a robot, in a private PyBullet client."""

from .kinematics import Kinematics
from .problem import PybulletProblem as IKProblem
from .problem import PybulletSolution

__all__ = ["IKProblem", "Kinematics", "PybulletSolution"]
