"""The message that tells the state of a base."""

from __future__ import annotations

from geometry_msgs.msg import Point, Quaternion, Twist, Vector3
from nav_msgs.msg import Odometry

from ..samples import BaseStateSample
from .frames import prefixed, world_frame
from .stamps import to_ros_time


def odometry_message(sample: BaseStateSample, stamp_ns: int) -> Odometry:
    """Returns pose and twist of a base; covariances are zero, since both are exact."""
    message = Odometry(child_frame_id=prefixed(sample.frame))
    message.header.frame_id = world_frame()
    message.header.stamp = to_ros_time(stamp_ns)
    message.pose.pose.position = Point(*sample.pose.position)
    message.pose.pose.orientation = Quaternion(*sample.pose.quat_xyzw)
    message.twist.twist = Twist(Vector3(*sample.twist.linear), Vector3(*sample.twist.angular))
    return message
