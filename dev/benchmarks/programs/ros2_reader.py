"""Reads the joint states of `stamped.py` with rclpy; needs ROS 2, and nothing of ROS 1."""

from __future__ import annotations

import gc
import json
import os
import sys
import threading
import time

import rclpy
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState


def main() -> None:
    """Reads a topic for some time [s] after the first messages; prints numbers and delays [s] as JSON."""
    topic, seconds = sys.argv[1], float(sys.argv[2])
    rclpy.init()
    gc.disable()  # the reader keeps all messages
    node = rclpy.create_node("reader")
    arrivals: list[tuple[float, float]] = []

    def on_state(state: JointState) -> None:
        sent_ns = state.header.stamp.sec * 1_000_000_000 + state.header.stamp.nanosec
        arrivals.append((state.position[0], (time.monotonic_ns() - sent_ns) * 1e-9))

    node.create_subscription(JointState, topic, on_state, QoSProfile(depth=1000))
    threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start()
    while not arrivals:
        time.sleep(0.01)
    print("ready", flush=True)
    time.sleep(1.0)
    first = len(arrivals)
    time.sleep(seconds)
    print("result:", json.dumps(arrivals[first:]), flush=True)
    os._exit(0)  # rclpy ends with an error while its thread still spins


if __name__ == "__main__":
    main()
