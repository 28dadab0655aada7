"""A subscriber that calls functions when keys are pressed."""

from collections.abc import Callable, Mapping
from typing import Any

import rospy
from keyboard.msg import Key


class KeyDownSubscriber(rospy.Subscriber):
    """Calls a function for each pressed key that is published on the topic `keyboard/keydown`.

    Args:
        key_action_map: Functions without arguments, indexed by key code, such as `{Key.KEY_a: start}`. Other keys are
            ignored.
    """

    def __init__(self, key_action_map: Mapping[int, Callable[[], Any]]) -> None:
        self._actions = dict(key_action_map)
        super().__init__("keyboard/keydown", Key, self._on_message, queue_size=100)

    def _on_message(self, message: Key) -> None:
        action = self._actions.get(message.code)
        if action is not None:
            action()
