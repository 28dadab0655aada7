"""Pose and velocity of a base."""

import math

from custom_ros_tools.errors import PhysicsError
from rpbi.samples import BaseStateSample

from .sensor import SensedBody, Sensor


class BaseStateSensor(Sensor):
    """Measures pose and twist of the URDF frame of a body's root link.

    Args:
        frame: Name of the root link's TF frame in samples, without prefix; by default `rpbi/NAME/ROOT_LINK`.
    """

    sample_type = BaseStateSample
    keeps_state = False
    ros_topic = "rpbi.ros.publishers.sample_topics:BASE_STATE"

    def __init__(self, body: SensedBody, hz: float, frame: str | None = None) -> None:
        super().__init__(body.name, hz)
        self._body = body
        self._frame = frame or f"rpbi/{body.name}/{body.root_link}"

    def read(self, tick: int) -> BaseStateSample:
        """Reads the URDF frame's pose in the world frame, and the URDF frame's twist in its own axes."""
        pose = self._body.base_pose()
        twist = self._body.base_twist()
        if not math.isfinite(sum(pose.position) + sum(twist.linear) + sum(twist.angular)):
            raise PhysicsError(f"{self.name}: base is not finite any more at tick {tick}: {pose.position}, {twist}")
        return BaseStateSample(self.name, self._frame, pose, twist.seen_from(pose.quat_xyzw))
