"""Messages from ROS 2 that wait for a subscriber in ROS 1."""

from __future__ import annotations

from typing import Any, cast

import pytest
from ros_system import wait_until
from std_msgs.msg import Float64

from rpbi_ros2 import routed_topics
from rpbi_ros2.layouts import COMMON_PACKAGES
from rpbi_ros2.routed_topics import IncomingTopic, MessageKind, serialized


class Arrivals:
    """A reader of one message."""

    is_matched, is_refused = True, False

    def __init__(self, cdr: bytes) -> None:
        self._left = [cdr]

    def take(self) -> list[bytes]:
        left, self._left = self._left, []
        return left

    def close(self) -> None:
        pass


@pytest.mark.parametrize(("longest_s", "is_dropped"), [(0.0, True), (60.0, False)])
def test_a_command_waits_for_its_subscriber_for_a_limited_time(ros, monkeypatch, longest_s, is_dropped):
    monkeypatch.setattr(routed_topics, "MAX_HELD_S", longest_s)
    kind = MessageKind("std_msgs/Float64", COMMON_PACKAGES)
    reader = cast(Any, Arrivals(kind.converter.to_cdr(serialized(Float64(0.5)))))
    topic = IncomingTopic("/late_command", kind, reader)
    topic.forward()
    assert topic.is_holding is not is_dropped
    heard = ros.listen("/late_command", Float64)
    if not is_dropped:
        wait_until(lambda: (topic.forward(), heard.messages)[1], "the command arrives")
    assert [each.data for each in heard.messages] == ([] if is_dropped else [0.5])
    topic.close()
