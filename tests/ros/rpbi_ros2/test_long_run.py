"""A minute of joint states at 1 kHz and a second of images at 30 Hz, with their delays next to a reader of ROS 1."""

from __future__ import annotations

import os
import statistics
import time

import pytest
import rospy
from ros2_system import JOINTS, SETTLED_S, STATE, connect
from ros_system import wait_until
from sensor_msgs.msg import Image, JointState

pytestmark = pytest.mark.thorough
COUNT = int(os.environ.get("RPBI_ROS2_COUNT", 60_000))


def publish(publisher: rospy.Publisher, message: JointState | Image, count: int, hz: float) -> None:
    """Publishes messages with their wall times as stamps, at a rate."""
    start = time.monotonic()
    for i in range(count):
        time.sleep(max(start + i / hz - time.monotonic(), 0.0))
        message.header.stamp = rospy.Time.from_sec(time.time())
        publisher.publish(message)


def delays_ms(arrivals: list[float], stamps: list[float]) -> list[float]:
    return sorted((arrival - stamp) * 1e3 for arrival, stamp in zip(arrivals, stamps))


@pytest.mark.parametrize(
    ("topic", "type_name", "message", "count", "hz"),
    [
        ("/arm/joint_states", STATE, JointState(name=JOINTS, position=[0.1] * 7), COUNT, 1000.0),
        (
            "/camera/image",
            "sensor_msgs/msg/Image",
            Image(width=640, height=480, encoding="rgb8", step=1920, data=bytes(921_600)),
            30,
            30.0,
        ),
    ],
    ids=["joint states", "images"],
)
def test_all_messages_arrive(ros, ros2, topic, type_name, message, count, hz, capsys):
    out = rospy.Publisher(topic, type(message), queue_size=1000, tcp_nodelay=True)
    try:
        heard = ros.listen(topic, type(message))
        ros2.bridge()
        peer = ros2.peer()
        peer.listen(topic, type_name, depth=1000)
        before = connect(peer, topic, out, type(message)())
        time.sleep(SETTLED_S)
        first = len(heard.messages)
        load = os.getloadavg()[0]
        wall = time.time() - time.monotonic()
        publish(out, message, count, hz)
        wait_until(lambda: peer.count(topic) >= before + count, "all have arrived", 60.0)
    finally:
        out.unregister()
    ros1 = delays_ms([each + wall for each in heard.arrival_s[first:]], [s * 1e-9 for s in heard.stamps_ns[first:]])
    there = delays_ms(peer.arrivals(topic)[before:], peer.stamps(topic)[before:])
    added = sorted(b - a for a, b in zip(ros1, there))
    with capsys.disabled():
        for name, each in (("ROS 1", ros1), ("ROS 2", there), ("added", added)):
            p99 = each[int(0.99 * len(each))]
            print(
                f"\n{topic}, {name}: {len(each)} of {count}, median {statistics.median(each):.2f} ms, p99 {p99:.2f} ms"
            )
        print(f"load {load:.1f} before, {os.getloadavg()[0]:.1f} after")
    assert len(there) == count
