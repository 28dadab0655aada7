"""Codes of keys."""

from custom_ros_tools.ros.key_down_subscriber import KeyDownSubscriber

__all__ = ["KeyDownSubscriber"]
