"""Targets that the guard's node cannot answer for."""

from __future__ import annotations

import time

import pytest
import rospy
from guarded_arm import SLIDER
from node_world import publishing
from ros_system import stop_group, wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from safe_robot.msg import Status

NODE = "robot_safety_node"
NAMES = ["slide", "turn"]


@pytest.fixture(scope="module")
def guard(module_ros):
    """A node that all of these tests use; none of them brings it to command anything."""
    rospy.set_param("/robot_description", SLIDER)
    rospy.set_param(f"/{NODE}/start_from", "target")
    process = module_ros.start(["rosrun", "safe_robot", "safe_robot_node.py"])
    rospy.wait_for_service("robot_safety/start_subscriber", timeout=60.0)
    statuses = module_ros.listen("robot_safety/status", Status)
    commands = module_ros.listen("joint_states/command", JointState)
    with publishing("joint_states/target", JointState) as send:
        wait_until(send.get_num_connections, "the guard listens")
        yield statuses, commands, send
    stop_group(process)


@pytest.mark.parametrize(
    "fields, words",
    [
        ({"position": (0.0, float("nan"))}, "values must be finite"),
        ({"name": ["slide"], "position": (0.0,)}, "no values for joint 'turn'"),
        ({"name": ["slide", "turn", "more"], "position": (0.0, 0.0, 0.0)}, "'more' too"),
        ({"effort": (1.0, 1.0)}, "expected no efforts"),
        ({"velocity": (9.0, 0.0)}, "joint 'slide': expected a velocity within 1.9, got 9"),
    ],
)
def test_what_cannot_be_answered_for_is_refused_and_named(module_ros, guard, fields, words):
    statuses, commands, send = guard
    module_ros.call("robot_safety/start_subscriber", Trigger)
    count = len(statuses.messages)
    message = JointState(**{"name": NAMES, "position": (0.0, 0.0), **fields})
    message.header.stamp = rospy.Time.from_sec(time.time())
    send.publish(message)
    status = statuses.wait_for(count + 1)[count]
    assert not status.is_safe and words in status.message
    assert commands.messages == []
