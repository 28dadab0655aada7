"""All private parts of rospy that this workspace uses.

rospy cannot send to many subscribers from one thread without waiting, cannot register again with a restarted ROS
master, and confuses connections. Each use is tested when a node starts. If rospy has different internals, one warning
names the expected part, the difference and the lost function, and the node continues without it.
"""

from .connections import close_poller_with, keep_accepting, keep_new_connections
from .master import Registry, answer_cached, registry
from .sending import DirectSending, RecorderQueues

__all__ = [
    "DirectSending",
    "RecorderQueues",
    "Registry",
    "answer_cached",
    "close_poller_with",
    "keep_accepting",
    "keep_new_connections",
    "registry",
]
