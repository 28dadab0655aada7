"""Re-exports services that switch a function on and off, and service proxies that wait for their service."""

from custom_ros_tools.ros.services import ToggleService, get_srv_handler, get_srv_handlers

__all__ = ["ToggleService", "get_srv_handler", "get_srv_handlers"]
