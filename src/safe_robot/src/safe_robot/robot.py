"""Former module of the guard's robot class, kept for existing imports; use `RobotModel` instead."""

from robot_model.model import RobotModel as GuardedRobot

__all__ = ["GuardedRobot"]
