"""Former place of the robot of a guard, which is a `RobotModel`."""

from robot_model.model import RobotModel as GuardedRobot

__all__ = ["GuardedRobot"]
