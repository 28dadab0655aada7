"""The table of topics that all windows into the world share."""

from __future__ import annotations

import pytest
import rospy
from ros_system import wait_until
from std_msgs.msg import Int32, String

from custom_ros_tools.ros.topic_table import TopicRow, TopicTable

pytestmark = pytest.mark.quick


class Changes:
    """Keeps the changes of one topic."""

    def __init__(self, name: str) -> None:
        self._name = name
        self.pairs: list[tuple[TopicRow | None, TopicRow | None]] = []

    def __call__(self, before: TopicRow | None, after: TopicRow | None) -> None:
        if (before or after).name == self._name:
            self.pairs.append((before, after))


def test_topics_appear_change_and_disappear(ros):
    changes = Changes("/shown")
    table = TopicTable(changes)
    table.look()
    assert "/shown" not in table.rows and "/rosout" in table.rows
    publisher = rospy.Publisher("/shown", String, queue_size=1)
    table.look()
    table.look()
    row = TopicRow("/shown", "std_msgs/String", frozenset([rospy.get_name()]))
    assert table.rows["/shown"] == row and changes.pairs == [(None, row)]
    publisher.unregister()
    table.look()
    assert "/shown" not in table.rows and changes.pairs[1:] == [(row, None)]


def test_type_of_a_topic_may_change(ros):
    changes = Changes("/retyped")
    table = TopicTable(changes)
    for message_type in (String, Int32):
        publisher = rospy.Publisher("/retyped", message_type, queue_size=1)
        table.look()
        table.learn("/retyped", {"latching": "1"})
        publisher.unregister()
        table.look()
    types = [(after.type, after.is_latched) for _, after in changes.pairs if after]
    assert types == [(name, latched) for name in ("std_msgs/String", "std_msgs/Int32") for latched in (None, True)]


def test_latching_is_learned_from_a_connection(ros):
    publisher = rospy.Publisher("/kept", String, latch=True, queue_size=1)
    publisher.publish("once")
    table = TopicTable()
    table.look()
    assert table.rows["/kept"].is_latched is None
    listener = ros.listen("/kept", rospy.AnyMsg)
    (message,) = listener.wait_for()
    table.learn("/kept", message._connection_header)
    table.learn("/never_seen", message._connection_header)
    table.look()
    assert table.rows["/kept"].is_latched and "/never_seen" not in table.rows
    publisher.unregister()


def test_subscribers_and_services_are_listed(ros):
    listener = ros.listen("/nobody_publishes", String)
    table = TopicTable()
    table.look()
    assert "/nobody_publishes" not in table.rows
    assert table.state.subscribers["/nobody_publishes"] == {rospy.get_name()}
    assert table.state.providers[f"{rospy.get_name()}/get_loggers"] == {rospy.get_name()}
    assert table.state.publishers["/rosout"] == table.rows["/rosout"].publishers
    listener.close()


def test_rows_stay_while_the_master_is_gone(ros, second_master, monkeypatch):
    monkeypatch.setenv("ROS_MASTER_URI", second_master.uri)
    second_master.api.registerPublisher("/far", "std_msgs/String", "http://localhost:1")
    table = TopicTable()
    table.look()
    assert table.rows["/far"].publishers == {"/tests"}
    second_master.kill()
    table.look()
    assert table.rows["/far"].publishers == {"/tests"}
    second_master.start()
    table.look()
    assert "/far" not in table.rows


def test_change_that_was_not_taken_is_offered_again(ros):
    refused = []

    def refuse_once(before: TopicRow | None, after: TopicRow | None) -> None:
        if after and after.name == "/offered" and not refused:
            refused.append(after)
            raise ValueError("not now")

    publisher = rospy.Publisher("/offered", String, queue_size=1)
    table = TopicTable(refuse_once)
    with pytest.raises(ValueError, match="not now"):
        table.look()
    assert "/offered" not in table.rows
    table.look()
    assert table.rows["/offered"] == refused[0]
    publisher.unregister()


def test_watch_looks_again_until_it_is_closed(ros):
    table = TopicTable()
    table.watch(20.0)
    publisher = rospy.Publisher("/watched", String, queue_size=1)
    wait_until(lambda: "/watched" in table.rows, "the table has the topic")
    table.close()
    publisher.unregister()
