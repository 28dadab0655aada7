"""rospy in one object."""

from rpbi.ros.ros_node import RosNode

__all__ = ["RosNode"]
