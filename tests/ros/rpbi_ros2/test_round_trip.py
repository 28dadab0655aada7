"""Messages that go from ROS 1 through rclpy back to ROS 1, and the tree of TF of made-up frames and of the demo."""

from __future__ import annotations

import random
from collections import defaultdict
from io import BytesIO
from typing import Any

import genpy
import pytest
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from random_messages import converted_classes, random_message, without_seq
from ros2_system import Ros2, built, connect
from ros_system import SUPPORT, wait_until
from tf2_msgs.msg import TFMessage

from rpbi_ros2.layouts import OWN_PACKAGES
from rpbi_ros2.message_packages_node import write_package

pytestmark = pytest.mark.thorough
WHEELS = ("actionlib_msgs", "diagnostic_msgs", "geometry_msgs", "nav_msgs", "rosgraph_msgs", "sensor_msgs", "std_msgs",
          "trajectory_msgs", "visualization_msgs")  # fmt: skip
TF = "tf2_msgs/msg/TFMessage"


def raw_of(message) -> bytes:
    buffer = BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def check_round_trip(ros, ros2, publisher, package: str) -> None:
    """Sends random messages of all types of a package through rclpy, and compares those that come back."""
    kinds = {message_class.__name__: message_class for message_class, _ in converted_classes(package)}
    assert kinds
    senders = {name: publisher(f"/there/{package}/{name}", each) for name, each in kinds.items()}
    back = {name: ros.listen(f"/back/{package}/{name}", each) for name, each in kinds.items()}
    bridge, peer = ros2.bridge(), ros2.peer()
    for name in kinds:
        peer.relay(f"/there/{package}/{name}", f"/back/{package}/{name}", f"{package}/msg/{name}")
    for name, message_class in kinds.items():
        first = random_message(message_class, random.Random(0))

        def is_back(name=name, first=first) -> bool:
            senders[name].publish(first)
            return bool(back[name].messages)

        try:
            wait_until(is_back, f"{name} is back", every_s=1.0)  # more copies would delay the messages after them
        except TimeoutError:
            print(ros.output(bridge), ros.output(peer.process), peer.topics())
            raise
        sent = [random_message(message_class, random.Random(seed)) for seed in range(1, 6)]
        for message in sent:
            senders[name].publish(message)
        expected = [without_seq(message_class().deserialize(raw_of(each))) for each in sent]

        def has_all(name=name, expected=expected) -> bool:
            return [without_seq(each) for each in back[name].messages][-len(expected) :] == expected

        wait_until(has_all, f"all of {name} are back and equal", 20.0)


@pytest.mark.parametrize("package", WHEELS)
def test_messages_return_equal_through_rclpy(ros, ros2, publisher, package):
    check_round_trip(ros, ros2, publisher, package)


@pytest.mark.parametrize("package", sorted(OWN_PACKAGES - {"control_msgs"}))
def test_own_messages_return_equal_through_packages_that_ros2_builds(ros, domain, tmp_path, publisher, package):
    written = write_package(package, tmp_path)
    assert written == sorted(message_class.__name__ for message_class, _ in converted_classes(package))
    check_round_trip(ros, Ros2(ros, domain, built(tmp_path / package)), publisher, package)


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


Tree = dict[str, dict[int, tuple[str, list[float]]]]
"""Parent, position [m] and quaternion x, y, z, w of frames, by name and stamp [ns]."""


def tree_of(messages: list[Any]) -> Tree:
    """Returns the transforms of messages of ROS 1, or of those of ROS 2 as dictionaries."""
    tree: Tree = defaultdict(dict)
    for message in messages:
        for each in message["transforms"] if isinstance(message, dict) else plain(message)["transforms"]:
            stamp, pose = each["header"]["stamp"], each["transform"]
            stamp_ns = stamp["sec"] * 1_000_000_000 + stamp["nanosec"]
            values = [*pose["translation"].values(), *pose["rotation"].values()]
            tree[each["child_frame_id"]][stamp_ns] = each["header"]["frame_id"], values
    return tree


def plain(message: Any) -> Any:
    """Returns a message of ROS 1 as dictionaries, as those of ROS 2 come."""
    if isinstance(message, genpy.Message):
        return {name: plain(getattr(message, name)) for name in message.__slots__}
    if isinstance(message, genpy.Time):
        return {"sec": message.secs, "nanosec": message.nsecs}
    return [plain(each) for each in message] if isinstance(message, list) else message


def differences(here: Tree, there: Tree) -> set[str]:
    """Returns the frames without a common stamp, or with another parent or pose at one."""
    different = here.keys() ^ there.keys()
    for name in here.keys() & there.keys():
        common = here[name].keys() & there[name].keys()
        pairs = [(here[name][stamp], there[name][stamp]) for stamp in common]
        if not pairs or any(a[0] != b[0] or a[1] != pytest.approx(b[1], rel=0.0, abs=1e-9) for a, b in pairs):
            different.add(name)
    return different


def test_tree_of_the_running_demo_is_that_of_ros1(ros, domain):
    ros2 = Ros2(ros, domain, built(SUPPORT / "ros2/tf2_msgs", SUPPORT / "ros2/control_msgs"))
    launch = ["roslaunch", "rpbi_examples", "basic_example_kuka_lwr.launch", "headless:=true", "ros2:=true"]
    ros.start(launch, ROS_DOMAIN_ID=str(domain))
    moving, fixed = ros.listen("/tf", TFMessage), ros.listen("/tf_static", TFMessage)
    peer = ros2.peer()
    peer.listen("/tf", TF, depth=1000)
    peer.listen("/tf_static", TF, depth=100, keeps=True)
    trees: dict[str, Tree] = {}

    def are_equal() -> bool:
        trees["here"] = tree_of([*moving.messages, *fixed.messages])
        trees["there"] = tree_of([*peer.messages("/tf"), *peer.messages("/tf_static")])
        return len(moving.messages) > 200 and not differences(trees["here"], trees["there"])

    try:
        wait_until(are_equal, "all frames are equal", every_s=2.0)
    except TimeoutError:
        assert differences(trees["here"], trees["there"]) == set()
        raise
    here = trees["here"]
    assert len(here) > 10 and {"rpbi/box", "rpbi/kuka_lwr/lwr_arm_7_link", "rpbi/camera"} <= here.keys()
    assert sum(len(here[name].keys() & trees["there"][name].keys()) for name in here) > 1000
    name = "rpbi/kuka_lwr/lwr_arm_7_link"
    stamp = max(here[name].keys() & trees["there"][name].keys())
    parent, values = here[name][stamp]
    here[name][stamp] = parent, [values[0] + 1e-8, *values[1:]]
    assert differences(here, trees["there"]) == {name}, "negative control"
