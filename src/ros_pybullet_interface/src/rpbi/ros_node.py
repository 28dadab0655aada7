"""Offers `RosNode` under the import path that scripts for the authors' original release use."""

from rpbi.ros.ros_node import RosNode

__all__ = ["RosNode"]
