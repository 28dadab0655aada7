"""Joint states through Python: published, heard and asked for by joint."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
import rospy
from node_world import Rosout, publishing
from ros_system import wait_until
from sensor_msgs.msg import JointState

from custom_ros_tools.joint_values import MissingJointsError
from custom_ros_tools.robot import JointStatePublisher, JointStateSubscriber, get_joint_state, resolve_joint_order

STATE = JointState(name=["a", "b", "c"], position=[1.0, 2.0, 3.0], effort=[4.0, 5.0, 6.0])


@pytest.fixture
def topic(request, ros):
    """A topic of this test and its publisher."""
    publisher = rospy.Publisher(f"/{request.node.originalname}", JointState, latch=True, queue_size=10)
    yield publisher
    publisher.unregister()


@pytest.mark.quick
def test_message_is_put_into_the_order_asked_for():
    STATE.header.frame_id = "arm"
    ordered = resolve_joint_order(STATE, ["c", "a"])
    assert (ordered.name, ordered.position, ordered.effort) == (["c", "a"], [3.0, 1.0], [6.0, 4.0])
    assert ordered.velocity == []
    assert ordered.header == STATE.header


def test_namespace_of_the_message_is_resolved():
    """Defect 45: with a namespace the release raised, or returned nothing."""
    message = JointState(name=["right/a", "left/a"], position=[1.0, 2.0])
    ordered = resolve_joint_order(message, ["a"], ns="left")
    assert (ordered.name, ordered.position) == (["a"], [2.0])


def test_missing_joint_is_an_error_that_names_it():
    with pytest.raises(MissingJointsError, match="'b'"):
        resolve_joint_order(JointState(name=["a", "c"], position=[1, 3]), ["a", "b", "c"])


def test_one_state_is_waited_for_and_ordered(topic):
    topic.publish(STATE)
    assert get_joint_state(topic.resolved_name, 60.0, ["b", "a"]).position == [2.0, 1.0]
    assert get_joint_state(topic.resolved_name, timeout=60.0).position == (1.0, 2.0, 3.0)
    with pytest.raises(MissingJointsError, match="'elbow'"):
        get_joint_state(topic.resolved_name, timeout=60.0, joint_names=["elbow"])


def test_state_that_does_not_come_in_time_is_an_error(ros):
    with pytest.raises(rospy.ROSException, match="timeout"):
        get_joint_state("/silent", timeout=0.05)


def test_newest_state_is_kept_in_order_and_passed_to_callbacks(topic):
    called = []
    heard = JointStateSubscriber(topic.resolved_name, ["c", "a"], callback=called.append)
    assert (heard.received(), heard.recieved(), heard.get(), heard.get_position()) == (False, False, None, None)
    topic.publish(STATE)
    wait_until(lambda: called, "it is heard")  # twice if it comes while they connect: sent, and as latched
    wait_until(lambda: heard.get() is called[-1], "the newest is kept")
    assert heard.received()
    np.testing.assert_array_equal(heard.get_position(), [3.0, 1.0])
    np.testing.assert_array_equal(heard.get_effort(), [6.0, 4.0])
    assert heard.get_velocity().shape == (0,), "the message has none"


def test_faulty_states_are_named_and_the_last_sound_one_stays(ros, topic):
    rosout = Rosout(ros, own=True)
    heard = JointStateSubscriber(topic.resolved_name, ["a"], ns="arm")
    topic.publish(JointState(name=["arm/a"], position=[1.0]))
    wait_until(heard.received, "it is heard")
    for position in (math.nan, 2.0):
        topic.publish(JointState(name=["arm/a" if math.isnan(position) else "a"], position=[position]))
    rosout.wait_for([f"{topic.resolved_name}: message refused: "])
    np.testing.assert_array_equal(heard.get_position(), [1.0])


def test_published_state_has_names_stamp_and_only_the_given_values(ros):
    publisher = JointStatePublisher("/published", ["a", "b"])
    heard = ros.listen("/published", JointState)
    wait_until(publisher.get_num_connections, "somebody listens")
    publisher.publish(np.array([1.0, 2.0]))
    heard.wait_for(1)
    publisher.publish(eff=[3.0, 4.0])
    first, second = heard.wait_for(2)
    assert (first.name, first.position, first.velocity, first.effort) == (["a", "b"], (1.0, 2.0), (), ())
    assert (second.position, second.effort) == ((), (3.0, 4.0))
    assert first.header.stamp > rospy.Time(0)


@pytest.mark.parametrize("faulty", [{"q": [1.0]}, {"qd": [1.0, math.nan]}, {"eff": [1.0, 2.0, 3.0]}])
def test_faulty_values_are_not_published(ros, faulty):
    with pytest.raises(ValueError):
        JointStatePublisher("/published", ["a", "b"]).publish(**faulty)


def test_slow_callback_gets_every_state(ros):
    """A demonstration recorded on a busy machine lost samples, since only the newest state was kept."""
    positions: list[float] = []

    def slow(state: JointState) -> None:
        if not positions:
            time.sleep(0.3)
        positions.append(state.position[0])

    subscriber = JointStateSubscriber("/slow", ["a"], callback=slow)
    with publishing("/slow", JointState) as publisher:
        for count in range(50):
            publisher.publish(JointState(name=["a"], position=[count]))
        wait_until(lambda: len(positions) == 50, "each state has come", 20.0)
    assert positions == list(range(50))
    subscriber.unregister()
