"""The example with the mobile base, as a user launches it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from ros_system import RosSystem, wait_until
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

LINKS = {"base_link", "turret", "upper_arm", "forearm", "hand"}
CORNER_M = 0.8
SLOW_S = 120.0


@pytest.fixture(scope="module")
def example(ros_master, tmp_path_factory):
    system = RosSystem(tmp_path_factory.mktemp("mobile_base"))
    arguments = ["headless:=true", "real_time_factor:=4"]
    try:
        system.start(["roslaunch", "rpbi_examples", "basic_example_mobile_base.launch", *arguments])
        yield system
    finally:
        system.close()


@pytest.fixture(scope="module")
def states(example):
    listener = example.listen("/rpbi/mobile_base/base_state", Odometry)
    listener.wait_for(1, SLOW_S)
    return listener


def _passed(states, x, y):
    """Tells whether the base has been at a point."""
    places = [state.pose.pose.position for state in list(states.messages)]
    return any(math.hypot(place.x - x, place.y - y) < 0.05 for place in places)


def _faced(states, yaw):
    """Tells whether the base has had a heading."""
    quats = [state.pose.pose.orientation for state in list(states.messages)]
    return any(abs(math.remainder(2.0 * math.atan2(quat.z, quat.w) - yaw, 2.0 * math.pi)) < 0.1 for quat in quats)


@pytest.mark.thorough
def test_it_drives_around_the_square_with_every_heading(states):
    for x, y in ((1, -1), (1, 1), (-1, 1), (-1, -1)):
        wait_until(lambda x=x, y=y: _passed(states, CORNER_M * x, CORNER_M * y), f"it passes corner {x}, {y}", SLOW_S)
    for turns in range(4):
        wait_until(lambda yaw=math.pi / 2.0 * turns: _faced(states, yaw), f"it faces {turns} quarters left", SLOW_S)
    # Sideways too, which only a holonomic base can.
    wait_until(lambda: any(abs(state.twist.twist.linear.y) > 0.4 for state in states.messages), "it goes sideways")


def test_it_keeps_to_its_limits(states):
    states.wait_for(100, SLOW_S)
    for state in states.messages:
        twist = state.twist.twist
        assert math.hypot(twist.linear.x, twist.linear.y) < 0.61
        assert abs(twist.angular.z) < 1.21
        assert (twist.linear.z, twist.angular.x, twist.angular.y) == (0.0, 0.0, 0.0)


def test_the_arm_swings_meanwhile(example):
    joint_states = example.listen("/rpbi/mobile_base/joint_states", JointState)
    names = joint_states.wait_for(1, SLOW_S)[0].name
    assert names == ["turret_joint", "shoulder_joint", "elbow_joint", "wrist_joint"]

    def ranges():
        positions = np.array([message.position for message in joint_states.messages[::20]])
        return np.ptp(positions, axis=0)

    wait_until(lambda: (ranges() > 1.0).all(), "every joint has swung", SLOW_S)


def test_robot_state_publisher_supplies_the_links_once(example):
    moving, still = example.listen("/tf", TFMessage), example.listen("/tf_static", TFMessage)
    expected = {f"rpbi/mobile_base/{link}" for link in LINKS}

    def parents(messages):
        found = {(one.child_frame_id, one.header.frame_id) for message in messages for one in message.transforms}
        return {pair for pair in found if pair[0].startswith("rpbi/mobile_base")}

    def newest():
        return moving.messages[-200:] + still.messages[:]  # all of them would take long each time

    wait_until(lambda: {child for child, _ in parents(newest())} == expected, f"TF has {expected}", SLOW_S)
    found = parents(moving.messages[:] + still.messages[:])
    assert len(found) == len(LINKS)
    assert ("rpbi/mobile_base/base_link", "rpbi/world") in found


@pytest.mark.thorough
def test_base_pushes_the_box_along(example, states):
    transforms = example.listen("/tf", TFMessage)

    def box_x():
        places = (
            one.transform.translation.x
            for message in reversed(transforms.messages)
            for one in message.transforms
            if one.child_frame_id == "rpbi/box"
        )
        return next(places, -math.inf)

    wait_until(lambda: box_x() > 1.2, "the box is at the end of the first side", SLOW_S)
