"""A source of targets that swings a robot, and then fails."""

from __future__ import annotations

import dataclasses
import math
import os
import signal
import time
from multiprocessing.connection import Connection

import rospy
from sensor_msgs.msg import JointState

HZ = 100
TARGET = "/joint_states/target"
NAMES = ["slide", "turn"]
MESSAGES = {
    "NaN": {"position": (math.nan, 0.0)},
    "infinite": {"position": (0.0, math.inf)},
    "no positions": {"position": ()},
    "missing joint": {"name": NAMES[:1], "position": (0.0,)},
    "unknown joint": {"name": [NAMES[0], "trun"]},
    "efforts": {"effort": (1.0, 1.0)},
}
"""Faults of messages: fields that are wrong."""
OTHER_TARGETS = ("joints swapped", "position jumps")
"""Faults of all messages from one on, which are targets all the same."""
STAMPS = {"stamps jump back": -1.0, "stamps jump ahead": 1.0, "late input": -0.15}
"""Faults of all stamps from one on: by how much they are wrong [s]."""
ENDS = ("kill -9", "SIGSTOP", "burst, kill -9", "burst, SIGSTOP")
"""Faults of the source's process; a burst is left behind by a source that has hung, and is ahead of its time."""
BURST = 10


@dataclasses.dataclass(frozen=True)
class Course:
    """What a source does: it swings, and has its fault after some targets.

    What is none of its own faults it only reports.
    """

    fault: str
    hz: float
    count: int
    is_for_good: bool
    """Whether all messages are wrong from one on; else only one is."""

    def position(self, k: int) -> tuple[float, float]:
        """Returns target k."""
        t = k / HZ
        swing = (1.0 - math.exp(-t)) ** 3 * math.sin(2.0 * math.pi * self.hz * t)
        return 0.25 * swing, 0.5 - 0.35 * swing


def stream(course: Course, report: Connection) -> None:
    """Publishes targets, from a process of its own, and reports when the fault was [s]."""
    rospy.init_node("source", anonymous=True, disable_signals=True, disable_rosout=True)
    publisher = rospy.Publisher(TARGET, JointState, queue_size=100, tcp_nodelay=True)
    while not (publisher.get_num_connections() and rospy.Time.now()):
        time.sleep(0.01)
    offset, begin_s, fault = rospy.Duration(0), time.monotonic(), course.fault

    def publish(k: int, **fields: object) -> None:
        message = JointState(**{"name": NAMES, "position": course.position(k), **fields})
        now = rospy.Time.now()
        message.header.stamp = now + offset if now else now
        publisher.publish(message)

    for k in range(100 * HZ):
        time.sleep(max(0.0, begin_s + k / HZ - time.monotonic()))
        if k == course.count and fault in ENDS:
            for ahead in range(BURST if "burst" in fault else 0):
                publish(k + ahead)
            time.sleep(0.002 if "burst" in fault else 0.0)  # rospy sends from a thread of its own
            report.send(time.monotonic())
            os.kill(os.getpid(), signal.SIGKILL if "kill" in fault else signal.SIGSTOP)
        elif k == course.count:
            offset = rospy.Duration.from_sec(STAMPS.get(fault, 0.0))
            report.send(time.monotonic())
        fields: dict[str, object] = {}
        if k == course.count or (k > course.count and course.is_for_good):
            fields = MESSAGES.get(fault, {})
        if k >= course.count and fault == "joints swapped":
            fields = {"name": NAMES[::-1]}
        if k >= course.count and fault == "position jumps":
            fields = {"position": tuple(value + 0.2 for value in course.position(k))}
        publish(k, **fields)
