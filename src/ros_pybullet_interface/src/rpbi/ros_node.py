"""Offers `RosNode` under the import path of the authors' release."""

from rpbi.ros.ros_node import RosNode

__all__ = ["RosNode"]
