"""Keys that are pressed."""

from .ros.key_down_subscriber import KeyDownSubscriber

__all__ = ["KeyDownSubscriber"]
