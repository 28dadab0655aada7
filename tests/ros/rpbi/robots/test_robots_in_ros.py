"""Robots as ROS users expect them: descriptions, several worlds on one master, states taken from elsewhere."""

from __future__ import annotations

import threading
import xml.etree.ElementTree as ElementTree
from contextlib import contextmanager
from pathlib import Path

import pytest
import rospy
import tf2_ros
from node_world import add, main_config, objects, publishing, remove
from ros_system import wait_until
from sensor_msgs.msg import JointState
from worlds import iiwa

from ros_pybullet_interface.msg import PybulletObject

FIRST = "lbr_iiwa_joint_1"
START_AT_REAL = {"initial_joint_state_topic": "/real/joint_states", "initial_joint_state_timeout_s": 60.0}


def test_robot_description_is_readable_by_rviz_until_robots_are_removed(ros, tmp_path):
    ros.simulator(main_config(tmp_path, robots=(iiwa(),)))
    text = rospy.get_param("/rpbi/iiwa/robot_description")
    meshes = [mesh.get("filename") for mesh in ElementTree.fromstring(text).iter("mesh")]
    assert meshes
    assert all(name.startswith("file:///") and Path(name[len("file://") :]).is_file() for name in meshes)
    load = {"fileName": "kuka_iiwa/model.urdf", "useFixedBase": True, "basePosition": [2.0, 0.0, 0.0]}
    assert add(ros, PybulletObject.ROBOT, iiwa("guest", loadURDF=load)).success
    assert rospy.has_param("/rpbi/guest/robot_description")
    assert remove(ros, "guest").success
    assert not rospy.has_param("/rpbi/guest/robot_description")


def test_robot_state_publisher_gives_the_same_link_frames(ros, tmp_path):
    """With our own link poses beside it under another prefix, both agree."""
    ros.simulator(
        main_config(
            tmp_path,
            robots=(
                iiwa(
                    broadcast_link_states=True,
                    initial_joint_position={"lbr_iiwa_joint_2": 40.0, "lbr_iiwa_joint_4": -60.0},
                ),
            ),
        )
    )
    rospy.set_param("/rsp/robot_description", rospy.get_param("/rpbi/iiwa/robot_description"))
    rospy.set_param("/rsp/robot_state_publisher/tf_prefix", "rsp")
    ros.start(
        [
            *("rosrun", "robot_state_publisher", "robot_state_publisher", "__ns:=/rsp"),
            "joint_states:=/rpbi/iiwa/joint_states",
        ]
    )
    buffer = ros.listen_to_tf()

    def pose(parent: str, child: str):
        transform = buffer.lookup_transform(parent, child, rospy.Time(0)).transform
        return (transform.translation.x, transform.translation.y, transform.translation.z)

    def both():
        try:
            return pose("rpbi/iiwa/lbr_iiwa_link_0", "rpbi/iiwa/lbr_iiwa_link_7"), pose(
                "rsp/lbr_iiwa_link_0", "rsp/lbr_iiwa_link_7"
            )
        except tf2_ros.TransformException:
            return None

    ours, theirs = wait_until(both, "both have told the hand's pose")
    assert ours == pytest.approx(theirs, abs=1e-3)


def test_two_worlds_share_a_master_and_a_tf_tree(ros, tmp_path):
    for side in ("left", "right"):
        (tmp_path / side).mkdir()
        ros.simulator(
            main_config(
                tmp_path / side,
                robots=(iiwa(broadcast_link_states=True, broadcast_link_states_hz=50.0),),
                tf_prefix=side,
            ),
            namespace=f"/{side}/",
        )
    assert objects(ros, "/left/") == objects(ros, "/right/") == {"iiwa": "robot"}
    left = ros.listen("/left/rpbi/iiwa/joint_states", JointState)
    right = ros.listen("/right/rpbi/iiwa/joint_states", JointState)
    with publishing("/left/rpbi/iiwa/joint_states/target", JointState) as target:
        target.publish(JointState(name=[FIRST], position=[0.5]))
        wait_until(lambda: left.messages and left.messages[-1].position[0] > 0.45, "the left arm moves")
    assert abs(right.wait_for(1)[-1].position[0]) < 0.01, "the right arm does not"
    buffer = ros.listen_to_tf()
    for side in ("left", "right"):
        frames = (f"{side}/rpbi/world", f"{side}/rpbi/iiwa/lbr_iiwa_link_7")
        wait_until(lambda frames=frames: buffer.can_transform(*frames, rospy.Time(0)), f"{frames} are on TF")
    assert not buffer.can_transform("left/rpbi/world", "right/rpbi/world", rospy.Time(0))


@contextmanager
def _saying(topic, message):
    """Publishes joint states again and again, as a real robot does."""
    stop = threading.Event()
    publisher = rospy.Publisher(topic, JointState, queue_size=1)

    def publish() -> None:
        while not stop.wait(0.05):
            publisher.publish(message)

    thread = threading.Thread(target=publish, daemon=True)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()
        publisher.unregister()


def test_a_robot_starts_where_another_one_is(ros, tmp_path):
    message = JointState(name=["gripper", FIRST, "lbr_iiwa_joint_4"], position=[0.02, 0.7, -1.1])
    robot = iiwa(**START_AT_REAL, initial_joint_position={"lbr_iiwa_joint_2": 20.0})
    with _saying("/real/joint_states", message):
        ros.simulator(main_config(tmp_path, robots=(robot,)))
        state = ros.listen("/rpbi/iiwa/joint_states", JointState).wait_for(1)[-1]
    positions = dict(zip(state.name, state.position))
    assert positions[FIRST] == pytest.approx(0.7, abs=2e-3)
    assert positions["lbr_iiwa_joint_4"] == pytest.approx(-1.1, abs=2e-3)
    assert positions["lbr_iiwa_joint_2"] == pytest.approx(0.349, abs=2e-3), "what the topic lacks is as configured"


def test_a_robot_to_start_at_that_says_nothing_is_named(ros, tmp_path):
    robot = iiwa(initial_joint_state_topic="/nobody/joint_states")
    node = ros.simulator(main_config(tmp_path, robots=(robot,)), wait=False)
    assert node.wait(120.0) == 1
    assert "initial_joint_state_topic: no joint states came on /nobody/joint_states within 5 s" in ros.output(node)


def test_half_a_message_to_start_from_is_refused_whole(ros, tmp_path):
    robot = iiwa(**START_AT_REAL)
    with _saying("/real/joint_states", JointState(name=[FIRST, "lbr_iiwa_joint_4"], position=[0.7])):
        node = ros.simulator(main_config(tmp_path, robots=(robot,)), wait=False)
        assert node.wait(120.0) == 1
    complaint = "expected a position for each name on /real/joint_states, got 2 names, 1 positions"
    assert f"initial_joint_state_topic: {complaint}" in ros.output(node)


def test_one_file_makes_several_robots(ros, tmp_path):
    config = main_config(tmp_path, robots=(iiwa(),))
    (file,) = config["robots"]
    config["robots"] = [
        {"file": file, "name": side, "loadURDF": {"basePosition": [0.0, y, 0.0]}}
        for side, y in (("l", 1.0), ("r", -1.0))
    ]
    ros.simulator(config)
    assert objects(ros) == {"l": "robot", "r": "robot"}
    assert rospy.has_param("/rpbi/l/robot_description")


def test_two_clocks_on_one_master_are_warned_of(ros, tmp_path):
    for side in ("left", "right"):
        (tmp_path / side).mkdir()
        node = ros.simulator(main_config(tmp_path / side), namespace=f"/{side}/", use_sim_time=True)
    wait_until(
        lambda: "/clock is published by /left/ros_pybullet_interface too" in ros.output(node), "the second one says so"
    )
