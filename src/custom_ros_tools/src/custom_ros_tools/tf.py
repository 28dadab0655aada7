"""Re-exports `TfInterface`, which reads and broadcasts TF transforms."""

from custom_ros_tools.ros.tf_interface import TfInterface

__all__ = ["TfInterface"]
