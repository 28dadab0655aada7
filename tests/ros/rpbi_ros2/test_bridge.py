"""Topics between ROS 1 and real ROS 2, and wrong messages, types and programs there. All tests share one bridge."""

from __future__ import annotations

import contextlib
import random
import time
from typing import Any

import pytest
import rospy
from control_msgs.msg import JointTrajectoryControllerState
from geometry_msgs.msg import Twist, WrenchStamped
from ros2_system import JOINTS, STATE, connect
from ros_system import wait_until
from sensor_msgs.msg import CameraInfo, Image, JointState
from std_msgs.msg import Float64MultiArray, String

TEXT = "std_msgs/msg/String"
TWIST = "geometry_msgs/msg/Twist"


def send(publisher: rospy.Publisher, messages: list[Any], hz: float) -> list[float]:
    """Publishes messages at a rate; returns the wall times at which they were sent [s]."""
    sent, start = [], time.monotonic()
    for i, message in enumerate(messages):
        time.sleep(max(start + i / hz - time.monotonic(), 0.0))
        sent.append(time.time())
        publisher.publish(message)
    return sent


def states(count: int) -> list[JointState]:
    generator, made = random.Random(1), []
    for i in range(count):
        state = JointState(
            name=JOINTS, **{key: [generator.gauss(0, 1) for _ in JOINTS] for key in ("position", "effort")}
        )
        state.header.stamp = rospy.Time(1 + i // 1000, i % 1000 * 1_000_000)
        made.append(state)
    return made


@pytest.mark.quick
def test_joint_states_at_1_khz_arrive_equal_and_in_order(peer, publisher):
    out = publisher("/arm/joint_states", JointState, tcp_nodelay=True)
    peer.listen("/arm/joint_states", STATE, depth=1000)
    before = connect(peer, "/arm/joint_states", out, JointState())
    sent = states(1000)
    send(out, sent, 1000.0)
    wait_until(lambda: peer.count("/arm/joint_states") >= before + len(sent), "all have arrived", 20.0)
    received = peer.messages("/arm/joint_states")[before:]
    assert [each["position"] for each in received] == [list(each.position) for each in sent]
    assert [each["header"]["stamp"]["nanosec"] for each in received] == [each.header.stamp.nsecs for each in sent]
    assert received[0]["name"] == JOINTS and received[0]["velocity"] == []
    ((reliability, durability, hash_text),) = peer.endpoints("/arm/joint_states")
    assert (reliability, durability) == ("RELIABLE", "VOLATILE") and hash_text.startswith("RIHS01_a13ee3a3")


@pytest.mark.thorough
def test_images_arrive_with_their_camera_info(peer, publisher):
    images, infos = publisher("/camera/image", Image), publisher("/camera/camera_info", CameraInfo)
    peer.listen("/camera/image", "sensor_msgs/msg/Image", depth=30)
    peer.listen("/camera/camera_info", "sensor_msgs/msg/CameraInfo", depth=30)
    before = connect(peer, "/camera/image", images, Image()), connect(peer, "/camera/camera_info", infos, CameraInfo())
    pixels = [random.Random(i).randbytes(640 * 480 * 3) for i in range(8)]
    info = CameraInfo(width=640, height=480, distortion_model="plumb_bob", D=[0.0] * 5, K=[float(i) for i in range(9)])
    for i, data in enumerate(pixels, 1):
        images.publish(Image(width=640, height=480, encoding="rgb8", step=1920, data=data))
        infos.publish(info)
        wait_until(lambda i=i: peer.count("/camera/image") >= before[0] + i, "the image has arrived", 20.0)
    wait_until(lambda: peer.count("/camera/camera_info") >= before[1] + len(pixels), "all infos have arrived", 20.0)
    assert [each["data"] for each in peer.messages("/camera/image")[before[0] :]] == pixels
    assert peer.messages("/camera/camera_info")[-1]["k"] == [float(i) for i in range(9)]


@pytest.mark.thorough
def test_topics_without_readers_are_not_subscribed_to(peer, publisher):
    out = publisher("/wanted/wrench", WrenchStamped)
    wait_until(lambda: "/wanted/wrench" in peer.topics(), "it is offered")
    assert peer.topics()["/wanted/wrench"] == ["geometry_msgs/msg/WrenchStamped"]
    assert out.get_num_connections() == 0
    peer.listen("/wanted/wrench", "geometry_msgs/msg/WrenchStamped")
    wait_until(out.get_num_connections, "it is subscribed to")
    peer.forget("/wanted/wrench")
    wait_until(lambda: out.get_num_connections() == 0, "it is not subscribed to any more")


def test_latched_texts_and_descriptions_reach_late_readers(peer, publisher):
    publisher("/world_description", String, latch=True).publish("a world")
    rospy.set_param("/arm/robot_description", "<robot name='arm'/>")
    for topic in ("/world_description", "/arm/robot_description"):
        wait_until(lambda topic=topic: topic in peer.topics(), "it is offered")
        peer.listen(topic, TEXT, keeps=True)
        wait_until(lambda topic=topic: peer.count(topic), "the text arrives", 20.0)
    assert peer.messages("/arm/robot_description") == [{"data": "<robot name='arm'/>"}]
    peer.forget("/world_description")
    peer.listen("/world_description", TEXT, keeps=True)
    wait_until(lambda: peer.count("/world_description") == 2, "the text arrives again", 20.0)
    assert peer.messages("/world_description") == [{"data": "a world"}] * 2
    rospy.set_param("/arm/robot_description", "<robot name='other'/>")
    wait_until(lambda: peer.count("/arm/robot_description") == 2, "the new text arrives", 20.0)


def test_first_command_from_ros2_is_not_lost(ros, peer):
    heard = ros.listen("/arm/target", JointState)
    twists = ros.listen("/base/cmd_vel", Twist)
    for topic, type_name in (("/arm/target", STATE), ("/base/cmd_vel", TWIST)):
        peer.write(topic, type_name)
        wait_until(lambda topic=topic: peer.readers(topic), "the bridge reads")
    time.sleep(1.0)  # Fast DDS names the reader some ms before the reader knows the publisher
    peer.publish("/arm/target", {"name": JOINTS, "position": [0.1 * i for i in range(7)]})
    peer.publish("/base/cmd_vel", {"linear": {"x": 0.5}, "angular": {"z": -1.0}})
    (target,), (twist,) = heard.wait_for(1), twists.wait_for(1)
    assert target.name == JOINTS and list(target.position) == [0.1 * i for i in range(7)]
    assert (twist.linear.x, twist.angular.z) == (0.5, -1.0)
    for i in range(50):
        peer.publish("/arm/target", {"name": JOINTS, "position": [float(i)] * 7})
    assert [each.position[0] for each in heard.wait_for(51)[1:]] == [float(i) for i in range(50)]


@pytest.mark.thorough
def test_own_messages_do_not_return(ros, peer, publisher):
    """A topic that both sides of ROS 1 have is carried in both directions."""
    out, heard = publisher("/both", Float64MultiArray), ros.listen("/both", Float64MultiArray)
    peer.listen("/both", "std_msgs/msg/Float64MultiArray", depth=100)
    peer.write("/both", "std_msgs/msg/Float64MultiArray")
    wait_until(lambda: peer.readers("/both") == 2 and out.get_num_connections() == 2, "both directions are open")
    out.publish(Float64MultiArray(data=[1.0]))
    heard.wait_for(1)
    peer.publish("/both", {"data": [2.0]})
    heard.wait_for(2)
    wait_until(lambda: peer.count("/both") == 2, "both have come")
    time.sleep(0.5)
    assert [each.data[0] for each in heard.messages] == [1.0, 2.0]
    assert sorted(each["data"][0] for each in peer.messages("/both")) == [1.0, 2.0]


@pytest.mark.thorough
def test_publisher_with_best_effort_is_named(ros, bridge, peer):
    ros.listen("/slack/target", JointState)
    wait_until(lambda: "/slack/target" in peer.topics(), "the bridge reads")
    peer.write("/slack/target", STATE, best_effort=True)
    wait_until(lambda: "/slack/target: a publisher in ROS 2 has best effort" in ros.output(bridge), "it is named")


def test_hostile_messages_are_dropped_and_others_pass(ros, bridge, peer):
    """Cyclone DDS itself compares each message with its type."""
    twists = ros.listen("/hostile/cmd_vel", Twist)
    peer.write("/hostile/cmd_vel", TWIST)
    wait_until(lambda: peer.readers("/hostile/cmd_vel"), "the bridge reads")
    for broken in (b"\0\1\0\0\1", b"\0\1\0\0" + bytes(8), b"\0\1\0\0" + bytes(400)):
        with contextlib.suppress(RuntimeError):  # rclpy refuses some itself
            peer.publish("/hostile/cmd_vel", broken)
    peer.publish("/hostile/cmd_vel", {"linear": {"x": 0.25}})
    wait_until(lambda: any(each.linear.x == 0.25 for each in twists.messages), "the other message passes")
    lines = [line for line in ros.output(bridge).splitlines() if "/hostile/cmd_vel" in line]
    assert lines and all("failed" in line or "refused" in line for line in lines) and bridge.poll() is None


@pytest.mark.thorough
def test_unknown_type_is_named_and_others_pass(ros, bridge, peer, publisher):
    publisher("/plan", JointTrajectoryControllerState)
    out = publisher("/known/joint_states", JointState)
    peer.listen("/known/joint_states", STATE)
    connect(peer, "/known/joint_states", out, JointState())
    line = "not connected with ROS 2: control_msgs/JointTrajectoryControllerState has other fields in ROS 2"
    assert ros.output(bridge).count(line) == 1 and "/plan" not in peer.topics()


@pytest.mark.thorough
def test_other_publisher_of_a_topic_is_named_once(ros, bridge, peer, publisher):
    publisher("/other/joint_states", JointState)
    peer.write("/other/joint_states", STATE)
    text = "has other publishers of /other/joint_states: is it the domain of another robot?"
    wait_until(lambda: text in ros.output(bridge), "it is named")
    assert ros.output(bridge).count(text) == 1 and bridge.poll() is None


@pytest.mark.thorough
def test_requests_without_sense_are_refused(ros, bridge, peer):
    request = "/rpbi/ros2/request"
    peer.listen("/rpbi/ros2/response", TEXT)
    peer.write(request, TEXT)
    wait_until(lambda: peer.readers(request), "the bridge reads")

    def is_answered() -> bool:
        peer.publish(request, {"data": '{"id": "fly", "call": "fly", "arguments": {}}'})
        return bool(peer.count("/rpbi/ros2/response"))

    wait_until(is_answered, "it answers")
    for bad in ("", "[]", "{}", "[" * 5000, '{"id": 1, "call": "start", "arguments": {}}', "x" * 2_000_000):
        peer.publish(request, {"data": bad})
    for call, arguments in (("step", '{"steps": "many"}'), ("move", "{}"), ("start", "{}"), ("start", "{}")):
        peer.publish(request, {"data": f'{{"id": "{call}", "call": "{call}", "arguments": {arguments}}}'})

    def answers() -> list[str]:
        return [each["data"] for each in peer.messages("/rpbi/ros2/response")]

    wait_until(lambda: all(f'"id": "{call}"' in " ".join(answers()) for call in ("step", "move", "start")), "answers")
    assert all('"success": false' in each for each in answers()) and "unknown call 'fly'" in answers()[0]
    assert "request from ROS 2 refused" in ros.output(bridge) and bridge.poll() is None


def test_second_bridge_in_a_domain_ends_with_one_line(ros, ros2, bridge):
    second = ros2.bridge("__name:=second")
    assert second.wait(30.0) == 1
    (line,) = ros.output(second).splitlines()[-1:]
    expected = f"another bridge connects domain {ros2.domain} already ("
    assert "[FATAL]" in line and expected in line and "~domain_id or ~prefix" in line
    assert bridge.poll() is None


@pytest.mark.thorough
def test_second_bridge_with_a_prefix_serves_too(ros2, bridge, peer, publisher):
    out = publisher("/shared/joint_states", JointState)
    prefixed = ros2.bridge("__name:=third", "_prefix:=other")
    for topic in ("/other/shared/joint_states", "/shared/joint_states"):
        wait_until(lambda topic=topic: topic in peer.topics(), "both have topics")
        peer.listen(topic, STATE)
        connect(peer, topic, out, JointState())
    assert bridge.poll() is None and prefixed.poll() is None
