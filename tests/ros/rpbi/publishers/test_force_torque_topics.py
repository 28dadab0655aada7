"""Force-torque sensors in ROS: topics, rates, frames, and the service that zeroes them."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import WrenchStamped
from node_world import Rosout, add, main_config, objects, remove
from ros_system import wait_until
from std_srvs.srv import Empty, Trigger
from worlds import iiwa

from ros_pybullet_interface.msg import PybulletObject
from ros_pybullet_interface.srv import RobotInfo, SetRealTimeFactor

JOINT = "lbr_iiwa_joint_7"
TOPIC = f"/rpbi/iiwa/{JOINT}/ft_sensor"
SENSORS = [
    {"joint": JOINT, "hz": 200, "bias_force_n": [3.0, 0.0, 0.0], "noise_force_n": 0.05},
    {"joint": "lbr_iiwa_joint_4", "hz": 40, "frame_id": "elbow"},
    "lbr_iiwa_joint_2",
]


@pytest.fixture(scope="module")
def node(module_ros):
    robot = iiwa(enabled_joint_force_torque_sensors=SENSORS, joint_state_publisher_hz=100)
    config = main_config(module_ros.folder, robots=(robot,), setAdditionalSearchPath="pybullet_data_path")
    return module_ros.simulator(config, use_sim_time=True)


@pytest.fixture
def simulator(ros, node):
    ros.call("/rpbi/start", Trigger)
    return node


def forces(messages):
    return np.array([[m.wrench.force.x, m.wrench.force.y, m.wrench.force.z] for m in messages])


@pytest.mark.quick
def test_each_sensor_has_a_topic_with_its_rate_and_frame(ros, simulator):
    expected = {
        JOINT: (5, "rpbi/iiwa/lbr_iiwa_link_7"),
        "lbr_iiwa_joint_4": (25, "elbow"),
        "lbr_iiwa_joint_2": (10, "rpbi/iiwa/lbr_iiwa_link_2"),
    }
    for joint, (period_ms, frame) in expected.items():
        messages = ros.listen(f"/rpbi/iiwa/{joint}/ft_sensor", WrenchStamped).wait_for(20)[:20]
        stamps = [message.header.stamp.to_nsec() for message in messages]
        assert {later - earlier for earlier, later in zip(stamps, stamps[1:])} == {period_ms * 1_000_000}
        assert {message.header.frame_id for message in messages} == {frame}


def test_robot_info_names_the_joints_with_sensors(ros, simulator):
    assert ros.call("/rpbi/iiwa/robot_info", RobotInfo).enabled_ft_sensors == [
        JOINT,
        "lbr_iiwa_joint_4",
        "lbr_iiwa_joint_2",
    ]


def test_zero_service_answers_when_the_sensor_shows_zero(ros, simulator):
    before = ros.listen(TOPIC, WrenchStamped)
    assert np.abs(forces(before.wait_for(50)).mean(axis=0)).max() > 1.0
    asked_ns = before.stamps_ns[-1]
    before.close()
    ros.call(TOPIC, Empty)
    after = ros.listen(TOPIC, WrenchStamped)  # by a connection of its own, since the other is closed
    assert forces(after.wait_for(200)).mean(axis=0) == pytest.approx([0.0, 0.0, 0.0], abs=0.03)
    assert after.stamps_ns[0] - asked_ns >= 95 * 5_000_000, "a hundred samples came before the answer"


def test_zero_service_of_a_stopped_simulation_says_so(ros, simulator):
    ros.call("/rpbi/stop", Trigger)
    with pytest.raises(rospy.ServiceException, match="stopped"):
        ros.call(TOPIC, Empty)


@pytest.fixture
def slowly(ros, simulator):
    """The world at a tenth of its pace, so that a hundred samples take long."""
    assert ros.call("/rpbi/set_real_time_factor", SetRealTimeFactor, 0.1).success
    yield
    assert ros.call("/rpbi/set_real_time_factor", SetRealTimeFactor, 1.0).success


def _fails_in_the_middle(topic, meanwhile, listener, reason):
    """Tells whether zeroing fails for a reason if something happens meanwhile; not if that came before the call."""
    rospy.wait_for_service(topic, 60.0)
    seen = len(listener.messages)
    with ThreadPoolExecutor(1) as callers:
        call = callers.submit(rospy.ServiceProxy(topic, Empty))
        listener.wait_for(seen + 2)
        meanwhile()
        error = call.exception(60.0)
    assert error is not None, "it ended well"
    return reason in str(error)


def test_stop_during_zeroing_ends_it_with_a_reason(ros, slowly):
    topic = "/rpbi/iiwa/lbr_iiwa_joint_4/ft_sensor"
    listener = ros.listen(topic, WrenchStamped)

    def stopped_in_the_middle():
        ros.call("/rpbi/start", Trigger)
        stop = partial(ros.call, "/rpbi/stop", Trigger)
        return _fails_in_the_middle(topic, stop, listener, "stopped before 100 samples")

    wait_until(stopped_in_the_middle, "it is stopped in the middle")
    assert abs(listener.messages[-1].wrench.force.y) > 1.0, "the old zero stays: y is up, and the forearm weighs"
    ros.call("/rpbi/set_real_time_factor", SetRealTimeFactor, 0.0)
    ros.call("/rpbi/start", Trigger)
    ros.call(topic, Empty)
    wait_until(lambda: abs(listener.messages[-1].wrench.force.y) < 1e-3, "it works the next time")


def test_removing_the_robot_during_zeroing_ends_it_with_a_reason(ros, slowly):
    sensors = [{"joint": JOINT, "hz": 100}]
    topic = f"/rpbi/other/{JOINT}/ft_sensor"
    listener = ros.listen(topic, WrenchStamped)

    def goes_in_the_middle():
        answer = add(ros, PybulletObject.ROBOT, iiwa("other", enabled_joint_force_torque_sensors=sensors))
        assert answer.success, answer.message
        return _fails_in_the_middle(topic, lambda: remove(ros, "other"), listener, "unknown object 'other'")

    wait_until(goes_in_the_middle, "it goes in the middle")
    wait_until(lambda: topic not in dict(rospy.get_published_topics()), "the topic has gone")
    assert "other" not in objects(ros)


def test_unknown_joint_is_refused_with_the_joints_there_are(ros, simulator):
    answer = add(ros, PybulletObject.ROBOT, iiwa("wrong", enabled_joint_force_torque_sensors=["joint_7"]))
    assert not answer.success
    assert "enabled_joint_force_torque_sensors[0]" in answer.message and "lbr_iiwa_joint_1" in answer.message


def test_unknown_joint_prevents_the_start_and_is_named(ros, simulator):
    robot = iiwa(enabled_joint_force_torque_sensors=["joint_7"])
    config = main_config(ros.folder, robots=(robot,), setAdditionalSearchPath="pybullet_data_path")
    rosout = Rosout(ros)
    failing = ros.simulator(config, use_sim_time=True, wait=False, namespace="/second/")
    assert failing.wait(60.0) == 1
    rosout.wait_for(["enabled_joint_force_torque_sensors[0]"])
