"""Services: one that switches on and off, and proxies that wait for theirs."""

from .ros.service_proxies import get_srv_handler, get_srv_handlers
from .ros.toggle_service import ToggleService

__all__ = ["ToggleService", "get_srv_handler", "get_srv_handlers"]
