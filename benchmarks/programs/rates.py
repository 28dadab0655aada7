"""Counts the messages of topics, and reads how fast /clock runs."""

from __future__ import annotations

import json
import struct
import sys
import time
from typing import Any

import rospy

CLOCK = "/clock"
FIRST = 3
"""Messages of each topic to wait for..."""
WAIT_S = 30.0
"""... at most for this time [s]; a topic that has none then is too slow."""
SETTLE_S = 1.0


def main() -> None:
    """Waits for every topic, counts for a while, prints the messages a second of each and the real-time factor."""
    seconds, topics = float(sys.argv[1]), sys.argv[2:]
    rospy.init_node("rates", anonymous=True, disable_rostime=True, disable_signals=True)
    counts = dict.fromkeys([CLOCK, *topics], 0)
    newest = [0.0]

    def count(message: Any, topic: str) -> None:
        counts[topic] += 1
        if topic == CLOCK:
            s, ns = struct.unpack("<II", message._buff)
            newest[0] = s + 1e-9 * ns

    for topic in counts:
        rospy.Subscriber(topic, rospy.AnyMsg, count, topic)
    end_s = time.monotonic() + WAIT_S
    while min(counts.values()) < FIRST and time.monotonic() < end_s:
        time.sleep(0.05)
    time.sleep(SETTLE_S)
    start_s, start, time_s = time.monotonic(), dict(counts), newest[0]
    time.sleep(seconds)
    wall_s, end, simulated_s = time.monotonic() - start_s, dict(counts), newest[0] - time_s
    rates = {topic: (end[topic] - start[topic]) / wall_s for topic in topics}
    print("result:", json.dumps({"factor": simulated_s / wall_s, "rates": rates}))


if __name__ == "__main__":
    main()
