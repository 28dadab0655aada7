"""Topics of a keyboard, with the names of the driver used by the release."""

from typing import Any

import rospy
from keyboard.msg import Key
from std_msgs.msg import Header

from operator_node.device import Reading
from operator_node.devices.held_keys import KeyEvent

from .topics import DeviceTopics

QUEUE_SIZE = 100


class KeyboardTopics(DeviceTopics):
    """Publishes each key that goes down or up, on `~keydown` and `~keyup`."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._publishers = {
            is_down: rospy.Publisher(f"~{name}", Key, queue_size=QUEUE_SIZE, tcp_nodelay=True)
            for is_down, name in ((True, "keydown"), (False, "keyup"))
        }

    def publish(self, reading: Reading, stamp: rospy.Time) -> None:
        for event in reading.events:
            if isinstance(event, KeyEvent):
                message = Key(header=Header(stamp=stamp), code=event.code, modifiers=event.modifiers)
                self._publishers[event.is_down].publish(message)
