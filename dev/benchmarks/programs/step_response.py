"""Sends position steps to a joint, and records the time until a joint state shows its motion."""

from __future__ import annotations

import argparse
import json
import random
import threading
import time

import rospy
from sensor_msgs.msg import JointState

MOVED = 1e-5  # [rad]
AT_REST = 1e-7  # [rad] in REST_S
REST_S = 0.05
STEP = 0.05  # [rad]


class Client:
    """Publishes targets and receives joint states.

    Args:
        joint: The joint that steps.
        state: Topic of the joint states.
        target: Topic of the targets.
    """

    def __init__(self, joint: str, state: str, target: str) -> None:
        self.position = float("nan")
        self.moved = threading.Event()
        self._joint = joint
        self._from = float("nan")
        self._arrival_s = 0.0
        self._publisher = rospy.Publisher(target, JointState, queue_size=10, tcp_nodelay=True)
        self._subscriber = rospy.Subscriber(state, JointState, self._on_message, tcp_nodelay=True)

    @property
    def is_connected(self) -> bool:
        """Whether targets have a subscriber and states a publisher."""
        return self._publisher.get_num_connections() > 0 and self._subscriber.get_num_connections() > 0

    def publish(self, position: float) -> None:
        """Publishes a target [rad]."""
        self._publisher.publish(JointState(name=[self._joint], position=[position]))

    def respond_s(self, position: float) -> float:
        """Publishes a target [rad] and returns how long it takes until the joint is seen to move [s]."""
        self._from = self.position
        self.moved.clear()
        start_s = time.monotonic()
        self.publish(position)
        if not self.moved.wait(5.0):
            raise RuntimeError(f"'{self._joint}' did not move")
        return self._arrival_s - start_s

    def wait_for_rest(self) -> None:
        """Waits until the joint rests."""
        before = float("nan")
        while not abs(self.position - before) <= AT_REST:
            before = self.position
            time.sleep(REST_S)

    def _on_message(self, message: JointState) -> None:
        arrival_s = time.monotonic()
        self.position = message.position[message.name.index(self._joint)]
        if abs(self.position - self._from) > MOVED and not self.moved.is_set():
            self._arrival_s = arrival_s
            self.moved.set()


def main() -> None:
    """Prints the latencies [s] of a number of trials as JSON."""
    parser = argparse.ArgumentParser()
    parser.add_argument("joint")
    parser.add_argument("state", help="topic of the joint states")
    parser.add_argument("target", help="topic of the targets")
    parser.add_argument("trials", type=int)
    arguments = parser.parse_args()
    rospy.init_node("step_response", disable_signals=True)
    client = Client(arguments.joint, arguments.state, arguments.target)
    while not client.is_connected:
        time.sleep(0.05)
    time.sleep(0.5)
    latencies = []
    client.publish(0.0)
    for trial in range(-5, arguments.trials):  # the first ones warm up
        client.wait_for_rest()
        time.sleep(random.uniform(0.0, 0.01))  # so that it comes at any phase of a tick
        latency_s = client.respond_s(0.0 if trial % 2 == 0 else STEP)
        if trial >= 0:
            latencies.append(latency_s)
    print("result:", json.dumps(latencies))


if __name__ == "__main__":
    main()
