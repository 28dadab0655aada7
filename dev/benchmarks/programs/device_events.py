"""Moves the emulated 6-D mouse, or publishes `joy`, and notes how long it takes until a topic says so."""

from __future__ import annotations

import argparse
import json
import random
import threading
import time
from collections.abc import Callable

import rospy
from sensor_msgs.msg import Joy
from std_msgs.msg import Float64MultiArray

from operator_node.emulators.spacenavd import SpacenavDaemon

WARM_UP = 20
PAUSE_S = (0.002, 0.02)
ANSWER_S = 1.0
"""What takes longer counts as so much."""
FULL = 1000
REST_S = 2.0
"""How long the node takes the cap, which does not move, for at rest, and some more."""


class Client:
    """Waits for a value on a topic."""

    def __init__(self, topic: str) -> None:
        self._expected, self._arrived = 0.0, threading.Event()
        self._arrival_s = 0.0
        kind, values_of = (Joy, lambda message: message.axes) if "signal" not in topic else (Float64MultiArray, _data)
        self.subscriber = rospy.Subscriber(
            topic, kind, lambda message: self._on_values(values_of(message)), queue_size=100, tcp_nodelay=True
        )

    def latency_s(self, send: Callable[[int], None], value: int) -> float:
        """Sends a value and returns how long it took until it came back [s]."""
        self._arrived.clear()
        self._expected = value / FULL
        start_s = time.monotonic()
        send(value)
        return self._arrival_s - start_s if self._arrived.wait(ANSWER_S) else ANSWER_S

    def _on_values(self, values: tuple[float, ...]) -> None:
        if values and abs(values[0] - self._expected) < 0.1 / FULL:
            self._arrival_s = time.monotonic()
            self._arrived.set()


def _data(message: Float64MultiArray) -> tuple[float, ...]:
    return message.data


def main() -> None:
    """Prints the latencies as JSON [s]."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("topic", help="what says so")
    parser.add_argument("count", type=int)
    parser.add_argument("--socket", help="where the 6-D mouse is served")
    parser.add_argument("--echo", help="the topic on which to publish instead")
    arguments = parser.parse_args()
    rospy.init_node("device_events", anonymous=True, disable_signals=True)
    client = Client(arguments.topic)
    if arguments.echo:
        publisher = rospy.Publisher(arguments.echo, Joy, queue_size=10, tcp_nodelay=True)
        _until(lambda: publisher.get_num_connections() and client.subscriber.get_num_connections())

        def send(value: int) -> None:
            publisher.publish(Joy(axes=[value / FULL, *[0.0] * 5], buttons=[0, 0]))
    else:
        daemon = SpacenavDaemon(arguments.socket)
        _until(lambda: daemon.clients and client.subscriber.get_num_connections())
        time.sleep(REST_S)

        def send(value: int) -> None:
            daemon.move(0, 0, value)

    generator = random.Random(1)
    latencies = []
    for trial in range(WARM_UP + arguments.count):
        latencies.append(client.latency_s(send, 1 + trial % (FULL - 1)))
        time.sleep(generator.uniform(*PAUSE_S))
    if not arguments.echo:
        daemon.close()
    print("result:", json.dumps(latencies[WARM_UP:]))


def _until(condition: Callable[[], object]) -> None:
    while not condition():
        time.sleep(0.05)


if __name__ == "__main__":
    main()
