"""rospy in one object."""

from .ros.ros_node import RosNode

__all__ = ["RosNode"]
