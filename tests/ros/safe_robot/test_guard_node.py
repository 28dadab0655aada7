"""The guard's node, between a program that sends targets and one that takes commands."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import pytest
import rospy
from guarded_arm import SLIDER
from node_world import publishing
from ros_system import Listener, wait_until
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from safe_robot.msg import Status, Violation

NODE = "robot_safety_node"
NAMES = ["slide", "turn"]


@pytest.fixture
def start(ros) -> Callable[..., Any]:
    """Starts the node for a robot without shapes, and waits until it is there."""

    def run(**parameters: Any) -> Any:
        rospy.set_param("/robot_description", SLIDER)
        options = {"start_from": "target", "period_s": 0.01, "limits": {"velocity": 1.0}, **parameters}
        for name, value in options.items():
            rospy.set_param(f"/{NODE}/{name}", value)
        process = ros.start(["rosrun", "safe_robot", "safe_robot_node.py"])
        rospy.wait_for_service("robot_safety/start_subscriber", timeout=60.0)
        return process

    return run


@pytest.fixture
def listen(ros) -> Callable[..., Listener]:
    """Listens to a topic of the node, from now on."""

    def connected(topic: str, message_type: type) -> Listener:
        listener = ros.listen(topic, message_type)
        wait_until(lambda: listener.is_connected, f"the node sends {topic} to the test")
        return listener

    return connected


@pytest.fixture
def target():
    """Publishes a target, with the present time unless another is given; returns the message."""
    publisher = rospy.Publisher("joint_states/target", JointState, queue_size=100, tcp_nodelay=True)

    def send(*position: float, age_s: float = 0.0, **fields: Any) -> JointState:
        message = JointState(**{"name": NAMES, "position": position, **fields})
        message.header.stamp = rospy.Time.from_sec(time.time() - age_s)
        wait_until(publisher.get_num_connections, "the guard listens")
        publisher.publish(message)
        return message

    yield send
    publisher.unregister()


def same(command: JointState, sent: JointState) -> bool:
    """Tells whether a message is another, but for its number, which ROS gives anew."""
    command.header.seq = sent.header.seq
    return command == sent


@pytest.mark.quick
def test_targets_pass_unchanged_until_one_is_unsafe_and_again_after_a_start(ros, start, target, listen):
    start()
    commands, statuses = listen("joint_states/command", JointState), listen("robot_safety/status", Status)
    violations = listen("robot_safety/violation", Violation)
    sent = []
    for k in range(5):
        position = (0.001 * k, -0.002 * k)
        sent.append(target(*position))
        assert same(commands.wait_for(k + 1)[k], sent[k])
    assert all(each.is_safe for each in statuses.wait_for(5))
    bad = target(0.5, 0.0)
    status = statuses.wait_for(6)[5]
    assert (status.is_safe, status.header.stamp) == (False, bad.header.stamp)
    assert status.message.startswith("joint_velocity: joint 'slide' would have ")
    violation = violations.wait_for()[0]
    assert (violation.check, violation.subject, violation.limit) == ("joint_velocity", "joint 'slide'", 0.95)
    target(0.004, -0.008)
    assert ros.call("robot_safety/start_subscriber", Trigger).success
    assert not ros.call("robot_safety/start_subscriber", Trigger).success
    again = target(0.004, -0.008)
    assert same(commands.wait_for(6)[5], again) and len(statuses.wait_for(7)) == 7
    assert ros.call("robot_safety/stop_subscriber", Trigger).success
    assert not ros.call("robot_safety/stop_subscriber", Trigger).success


def test_commands_of_a_burst_go_out_a_period_apart(ros, start, target, listen):
    """Late targets that come together make the robot no faster."""
    start(period_s=0.2, checks={"staleness": {"timeout_s": 10.0}})
    commands = listen("joint_states/command", JointState)
    statuses = listen("robot_safety/status", Status)
    target(0.0, 0.0)
    commands.wait_for(1)
    for k in range(1, 4):
        target(0.001 * k, 0.0)
    commands.wait_for(4)
    took_s = commands.arrival_s[3] - commands.arrival_s[0]
    assert took_s >= 0.4, took_s  # 0.6 s there, and the first may have arrived late
    assert all(each.is_safe for each in statuses.messages)


def test_joints_in_another_order_are_taken_by_name_and_numbers_come_in_the_robots_order(ros, start, target, listen):
    start(publish_as_joint_state=False)
    numbers = listen("joint_states/command", Float64MultiArray)
    target(7.0, 0.3, -0.2, name=["mount", "turn", "slide"])  # that of the mount is fixed
    assert numbers.wait_for()[0].data == (-0.2, 0.3)


def test_a_target_that_is_too_old_and_a_source_that_dies_while_the_robot_moves_halt_it(ros, start, target, listen):
    start()
    statuses = listen("robot_safety/status", Status)
    target(0.0, 0.0, age_s=1.0)
    assert "staleness: the age of the target" in statuses.wait_for()[0].message
    ros.call("robot_safety/start_subscriber", Trigger)
    target(0.0, 0.0)
    statuses.wait_for(2)
    target(0.001, 0.0)
    last = statuses.wait_for(4)
    assert [each.is_safe for each in last[1:]] == [True, True, False]
    assert "time without a target while the robot moves" in last[3].message


def test_the_first_target_waits_for_measured_positions(ros, start, target, listen):
    start(start_from="measured")
    statuses = listen("robot_safety/status", Status)
    commands = listen("joint_states/command", JointState)
    target(0.0, 0.0)
    assert "start: measured positions" in statuses.wait_for()[0].message
    with publishing("joint_states/measured", JointState) as measured:
        message = JointState(name=["turn", "slide", "more"], position=[0.0, 0.01, 5.0])
        wait_until(
            lambda: measured.publish(message) or target(0.0, 0.0) and commands.messages, "a command comes", every_s=0.1
        )


def test_parameters_of_the_release_are_taken(ros, start, target, listen):
    start(
        limits={},
        exotica_xml_filename="any.xml",
        joint_velocity_limit="0.4 3",
        joint_position_upper_limit="0.5 2",
        joint_velocity_limit_factor=0.5,
        checker={"jointpositionlimit": {"active": False}, "linkboxlimit": {"active": True}},
        links="hand",
        box_xlim="-0.1 inf",
    )
    statuses = listen("robot_safety/status", Status)
    target(0.0, 0.0)
    target(0.0021, 0.0)
    assert "would have 0.21 m/s; the limit is 0.2" in statuses.wait_for(2)[1].message
    ros.call("robot_safety/start_subscriber", Trigger)
    target(-0.0005, 0.0)
    assert statuses.wait_for(3)[2].is_safe


@pytest.mark.parametrize(
    "parameters, words",
    [
        ({"checks": {"link_box": {"boxes": {"hnd": {}}}}}, f"/{NODE}: checks.link_box.boxes.hnd: unknown link 'hnd'"),
        ({"joint_velocity_limit": "1 2 3"}, f"/{NODE}: joint_velocity_limit: expected 2 numbers"),
        ({"polcy": "limit"}, f"/{NODE}: polcy: unknown key"),
    ],
)
def test_a_parameter_that_is_wrong_ends_the_node_with_what_is_wrong(ros, parameters, words):
    rospy.set_param("/robot_description", SLIDER)
    for name, value in parameters.items():
        rospy.set_param(f"/{NODE}/{name}", value)
    process = ros.start(["rosrun", "safe_robot", "safe_robot_node.py"])
    assert process.wait(60.0) == 1
    assert words in ros.output(process)
