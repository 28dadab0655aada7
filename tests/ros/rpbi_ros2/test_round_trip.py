"""Messages that go from ROS 1 through rclpy back to ROS 1, the tree of TF, and own messages as packages of ROS 2."""

from __future__ import annotations

import random
from io import BytesIO

import pytest
import rospy
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from random_messages import converted_classes, random_message, without_seq
from ros2_system import Ros2, built, connect
from ros_system import SUPPORT, wait_until
from tf2_msgs.msg import TFMessage

from rpbi_ros2.message_packages_node import write_package
from safe_robot.msg import Status

pytestmark = pytest.mark.thorough
WHEELS = ("actionlib_msgs", "diagnostic_msgs", "geometry_msgs", "nav_msgs", "rosgraph_msgs", "sensor_msgs", "std_msgs",
          "trajectory_msgs", "visualization_msgs")  # fmt: skip
TF = "tf2_msgs/msg/TFMessage"


def raw_of(message) -> bytes:
    buffer = BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


@pytest.mark.parametrize("package", WHEELS)
def test_messages_return_equal_through_rclpy(ros, ros2, publisher, package):
    kinds = {message_class.__name__: message_class for message_class, _ in converted_classes(package)}
    senders = {name: publisher(f"/there/{name}", each) for name, each in kinds.items()}
    back = {name: ros.listen(f"/back/{name}", each) for name, each in kinds.items()}
    ros2.bridge()
    peer = ros2.peer()
    for name in kinds:
        peer.relay(f"/there/{name}", f"/back/{name}", f"{package}/msg/{name}")
    for name, message_class in kinds.items():
        first = random_message(message_class, random.Random(0))

        def is_back(name=name, first=first) -> bool:
            senders[name].publish(first)
            return bool(back[name].messages)

        wait_until(is_back, f"{name} is back")
        sent = [random_message(message_class, random.Random(seed)) for seed in range(1, 6)]
        for message in sent:
            senders[name].publish(message)
        expected = [without_seq(message_class().deserialize(raw_of(each))) for each in sent]

        def has_all(name=name, expected=expected) -> bool:
            return [without_seq(each) for each in back[name].messages][-len(expected) :] == expected

        wait_until(has_all, f"all of {name} are back and equal", 20.0)


def transform(parent: str, child: str, generator: random.Random) -> TransformStamped:
    made = TransformStamped(child_frame_id=child)
    made.header.frame_id = parent
    made.transform.translation = Vector3(*(generator.gauss(0, 1) for _ in range(3)))
    made.transform.rotation = Quaternion(0.0, 0.0, 0.6, 0.8)
    return made


def test_tree_of_tf_is_that_of_ros1(ros, domain, publisher):
    ros2 = Ros2(ros, domain, built(SUPPORT / "ros2/tf2_msgs", SUPPORT / "ros2/control_msgs"))
    generator = random.Random(1)
    fixed = [[transform("world", f"fixed_{i}_{j}", generator) for j in range(3)] for i in range(2)]
    moving = [transform("world", f"link_{i}", generator) for i in range(30)]
    # rospy has one publisher a topic in each process: the second message is that of another publisher, too
    latched = publisher("/tf_static", TFMessage, latch=True)
    out = publisher("/tf", TFMessage)
    ros2.bridge()
    peer = ros2.peer()
    peer.listen("/tf", TF, depth=100)
    for transforms in fixed:
        latched.publish(TFMessage(transforms))
        wait_until(latched.get_num_connections, "the bridge reads the fixed ones")
    connect(peer, "/tf", out, TFMessage(moving))
    peer.listen("/tf_static", TF, depth=100, keeps=True)
    wanted = {each.child_frame_id: each for each in (*fixed[0], *fixed[1], *moving)}

    def tree() -> dict:
        messages = [*peer.messages("/tf"), *peer.messages("/tf_static")]
        return {each["child_frame_id"]: each for message in messages for each in message["transforms"]}

    wait_until(lambda: tree().keys() == wanted.keys(), "all frames are there", 20.0)
    for name, each in tree().items():
        sent = wanted[name]
        assert each["header"]["frame_id"] == sent.header.frame_id
        for part, axes in (("translation", "xyz"), ("rotation", "xyzw")):
            values = [getattr(getattr(sent.transform, part), axis) for axis in axes]
            assert [each["transform"][part][axis] for axis in axes] == values


def test_own_messages_are_read_by_a_package_that_ros2_builds(ros, domain, tmp_path, publisher):
    assert write_package("safe_robot", tmp_path) == ["Status", "Violation"]
    ros2 = Ros2(ros, domain, built(tmp_path / "safe_robot"))
    out = publisher("/safe_robot/status", Status)
    ros2.bridge()
    peer = ros2.peer()
    peer.listen("/safe_robot/status", "safe_robot/msg/Status")
    message = random_message(Status, random.Random(3))
    message.header.stamp = rospy.Time(12, 34)
    connect(peer, "/safe_robot/status", out, message)
    received = peer.last("/safe_robot/status")
    assert received["message"] == message.message and received["is_safe"] == message.is_safe
    assert received["header"]["stamp"] == {"sec": 12, "nanosec": 34}
