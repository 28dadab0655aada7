"""Provides `RosNode` under the import path that scripts for the original ros_pybullet_interface use."""

from rpbi.ros.ros_node import RosNode

__all__ = ["RosNode"]
