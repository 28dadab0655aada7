"""All uses of rospy's private parts in this workspace.

The private parts are used since rospy cannot send to many subscribers from one thread without waiting, cannot register
again with a restarted ROS master, and sometimes confuses connections. Each use is tested when a node starts. If rospy
has unexpected internals, a warning names the expected part, the difference and the function that is lost. The node then
continues without this function.
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
