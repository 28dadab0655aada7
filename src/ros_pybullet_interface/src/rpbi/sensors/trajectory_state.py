"""How far a robot is with its trajectory."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rpbi.control.trajectories.controller_state import ControllerState

from .sensor import Sensor

if TYPE_CHECKING:
    from rpbi.bodies.robots.robot import Robot
    from rpbi.control.trajectories.follower import TrajectoryFollower


class TrajectoryStateSensor(Sensor):
    """Where the joints of a robot's follower of trajectories are to be, and where they are.

    Args:
        robot: The robot.
        follower: Its follower.
    """

    sample_type = ControllerState

    def __init__(self, robot: Robot, follower: TrajectoryFollower) -> None:
        super().__init__(robot.name, follower.config.state_publish_rate)
        self._dt_s = robot.dt_s
        self._follower = follower

    def read(self, tick: int) -> ControllerState:
        """Reads the joints that the follower drives."""
        return self._follower.state(tick * self._dt_s)
