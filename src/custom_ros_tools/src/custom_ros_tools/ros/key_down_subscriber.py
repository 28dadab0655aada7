"""Calls functions when keys are pressed."""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

import rospy

from custom_ros_tools.errors import MissingDependency


class KeyDownSubscriber:
    """Calls functions by key code, such as `{Key.KEY_a: start}`, when keys go down, as told on `keyboard/keydown`.

    Raises:
        MissingDependency: If the ROS package `keyboard`, which has the message, is not installed.
    """

    def __init__(self, callbacks: Mapping[int, Callable[[], Any]]) -> None:
        self._callbacks = dict(callbacks)
        try:
            key_type = import_module("keyboard.msg").Key
        except ImportError:
            how = "build the ROS package 'keyboard' (ros-keyboard) in this workspace and source it"
            raise MissingDependency("keyboard/Key", how) from None
        self._subscriber = rospy.Subscriber("keyboard/keydown", key_type, self._take, queue_size=100)

    def _take(self, message: Any) -> None:
        callback = self._callbacks.get(message.code)
        if callback is not None:
            callback()
