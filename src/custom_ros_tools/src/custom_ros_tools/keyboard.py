"""Re-exports `KeyDownSubscriber`, which receives the codes of pressed keys."""

from custom_ros_tools.ros.key_down_subscriber import KeyDownSubscriber

__all__ = ["KeyDownSubscriber"]
