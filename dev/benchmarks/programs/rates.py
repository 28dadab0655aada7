"""Counts the messages of topics, and finds how fast simulated time runs."""

from __future__ import annotations

import json
import struct
import sys
import time
from collections.abc import Callable
from typing import Any

import rospy
from diagnostic_msgs.msg import DiagnosticArray

CLOCK, FACTOR = "/clock", "real_time_factor"
START_S = 60.0
"""Longest time to wait for a message of any topic [s]."""
WAIT_S = 5.0
"""Longest time to wait for the others then [s]; a topic that has none is too slow."""
SETTLE_S = 1.0


def main() -> None:
    """Waits for every topic, counts for a while, prints the messages a second of each and the real-time factor."""
    seconds, topics = float(sys.argv[1]), sys.argv[2:]
    rospy.init_node("rates", anonymous=True, disable_rostime=True, disable_signals=True)
    counts = dict.fromkeys([CLOCK, *topics], 0)
    newest, factors = [0.0], dict[str, float]()

    def count(message: Any, topic: str) -> None:
        counts[topic] += 1
        if topic == CLOCK:
            s, ns = struct.unpack("<II", message._buff)
            newest[0] = s + 1e-9 * ns

    def diagnose(message: DiagnosticArray) -> None:
        for status in message.status:
            factors.update((status.name, float(each.value)) for each in status.values if each.key == FACTOR)

    for topic in counts:
        rospy.Subscriber(topic, rospy.AnyMsg, count, topic)
    rospy.Subscriber("/diagnostics", DiagnosticArray, diagnose)
    _wait_until(lambda: any(counts[topic] for topic in topics), START_S)
    _wait_until(lambda: all(counts[topic] for topic in topics), WAIT_S)
    time.sleep(SETTLE_S)
    start_s, start, time_s = time.monotonic(), dict(counts), newest[0]
    time.sleep(seconds)
    wall_s, end, simulated_s = time.monotonic() - start_s, dict(counts), newest[0] - time_s
    rates = {topic: (end[topic] - start[topic]) / wall_s for topic in topics}
    factor = simulated_s / wall_s if counts[CLOCK] else min(factors.values(), default=0.0)  # none with wall time
    print("result:", json.dumps({"factor": factor, "rates": rates}))


def _wait_until(condition: Callable[[], bool], most_s: float) -> None:
    end_s = time.monotonic() + most_s
    while not condition() and time.monotonic() < end_s:
        time.sleep(0.05)


if __name__ == "__main__":
    main()
