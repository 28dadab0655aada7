"""Functions called by keys."""

from __future__ import annotations

import pytest
import rospy
from keyboard.msg import Key
from ros_system import wait_until

from custom_ros_tools.keyboard import KeyDownSubscriber


@pytest.mark.quick
def test_each_key_calls_its_function_and_others_call_none(ros):
    pressed: list[str] = []
    actions = {Key.KEY_a: lambda: pressed.append("a"), Key.KEY_b: lambda: pressed.append("b")}
    subscriber = KeyDownSubscriber(key_action_map=actions)
    publisher = rospy.Publisher("/keyboard/keydown", Key, queue_size=10)
    wait_until(publisher.get_num_connections, "it listens")
    for code in (Key.KEY_b, Key.KEY_c, Key.KEY_a):
        publisher.publish(Key(code=code))
    wait_until(lambda: len(pressed) >= 2, "both are called")
    assert pressed == ["b", "a"]
    subscriber.unregister()
    publisher.unregister()
