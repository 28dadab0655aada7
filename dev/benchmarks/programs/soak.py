"""Records messages and memory of a simulator for a long time, while a controller commands it."""

from __future__ import annotations

import argparse
import json
import math
import statistics
import threading
import time
from collections.abc import Callable

import rospy
from processes import handles, memory_mb, process_of
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Int64

NODES = {"simulator": "/ros_pybullet_interface", "camera": "/ros_pybullet_interface_camera"}
TARGET_HZ = 50.0
WARM_UP_SHARE = 0.1
"""Share of the time after which memory and handles count; buffers fill and caches grow before."""
WARM_UP_MESSAGES = 10
"""Of each topic before that time begins, however slow the machine is."""


class Count:
    """Number of arrivals, and the longest time between two of them [s]."""

    def __init__(self, topic: str, message_type: type) -> None:
        self.number, self.longest_gap_s = 0, 0.0
        self._last_s = math.inf
        rospy.Subscriber(topic, message_type, self._on_message, tcp_nodelay=True)

    def _on_message(self, _: object) -> None:
        now_s = time.monotonic()
        self.longest_gap_s = max(self.longest_gap_s, now_s - self._last_s)
        self._last_s = now_s
        self.number += 1

    def restart(self) -> None:
        """Counts from now on."""
        self.number, self.longest_gap_s, self._last_s = 0, 0.0, math.inf


def main() -> None:
    """Prints its records as JSON."""
    parser = argparse.ArgumentParser()
    parser.add_argument("seconds", type=float, help="how long")
    parser.add_argument("robot")
    parser.add_argument("joint", help="joint that is moved to and fro")
    arguments = parser.parse_args()
    rospy.init_node("soak", disable_rostime=True, disable_signals=True)
    counts = {
        "statuses": Count("rpbi/status", Int64),
        "joint_states": Count(f"rpbi/{arguments.robot}/joint_states", JointState),
        "images": Count("rpbi/camera/colour/image", Image),
    }
    threading.Thread(target=_control, args=(arguments.robot, arguments.joint), daemon=True).start()
    while not all(count.number >= WARM_UP_MESSAGES for count in counts.values()):
        time.sleep(0.01)
    processes = {name: process_of(node) for name, node in NODES.items()}
    held: dict[str, list[float]] = {name: [] for name in processes}
    time.sleep(WARM_UP_SHARE * arguments.seconds)
    handle_counts: list[float] = []
    for count in counts.values():
        count.restart()
    start_s = time.monotonic()
    while time.monotonic() - start_s < arguments.seconds:
        for name, process_id in processes.items():
            held[name].append(memory_mb(process_id))
        handle_counts.append(sum(map(handles, processes.values())))
        time.sleep(min(1.0, arguments.seconds / 100))
    wall_s = time.monotonic() - start_s
    first, last = _ends(handle_counts, min)  # a call to the master takes one for a moment, once a second
    found = {
        "wall_s": wall_s,
        "memory_mb": {name: statistics.median(values) for name, values in held.items()},
        "growth": {name: _growth(values) for name, values in held.items()},
        "new_handles": last - first,
        **{name: count.number for name, count in counts.items()},
        "longest_gaps_s": {name: count.longest_gap_s for name, count in counts.items()},
    }
    print("result:", json.dumps(found))


def _control(robot: str, joint: str) -> None:
    target = rospy.Publisher(f"rpbi/{robot}/joint_states/target", JointState, queue_size=10)
    while not rospy.is_shutdown():
        target.publish(JointState(name=[joint], position=[0.3 * math.sin(time.monotonic())]))
        time.sleep(1.0 / TARGET_HZ)


def _ends(values: list[float], of: Callable[[list[float]], float] = statistics.median) -> tuple[float, float]:
    """Returns the medians, or another statistic, of the first and of the last tenth."""
    tenth = max(1, len(values) // 10)
    return of(values[:tenth]), of(values[-tenth:])


def _growth(values: list[float]) -> float:
    """Returns how much the last tenth is above the first, as a share of the first."""
    first, last = _ends(values)
    return last / first - 1.0


if __name__ == "__main__":
    main()
