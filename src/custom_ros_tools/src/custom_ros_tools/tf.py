"""TF in one object."""

from custom_ros_tools.ros.tf_interface import TfInterface

__all__ = ["TfInterface"]
