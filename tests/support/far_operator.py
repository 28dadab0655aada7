"""An operator on another computer: swings a joint by targets, and prints what comes back, as JSON lines.

Arguments: the topic of joint states, the topic of targets, the joint, targets a second, and the swing's amplitude [rad].
Lines have the number of joint states so far, the ROS time and the stamp of the newest [s], its position, effort and the
newest target; `lag_s` is how long ago the swing was where the joint is now, on average over the last two seconds.
"""

from __future__ import annotations

import json
import math
import sys
import threading
import time
from collections import deque

import numpy as np
import rospy
from sensor_msgs.msg import JointState

PERIOD_S, REPORT_S = 4.0, 0.25


def main() -> None:
    """Runs until the master's node ends it."""
    states, targets, joint, hz, amplitude = rospy.myargv()[1:]
    rospy.init_node("operator", disable_rostime=True)
    publisher = rospy.Publisher(targets, JointState, queue_size=100, tcp_nodelay=True)
    recent: deque[tuple[float, float, float]] = deque(maxlen=4000)
    count, newest, effort_max = 0, None, 0.0

    def take(message: JointState) -> None:
        nonlocal count, newest, effort_max
        index = message.name.index(joint)
        count += 1
        newest = message
        effort_max = max(effort_max, abs(message.effort[index]))
        recent.append((time.monotonic() - start_s, message.position[index], abs(message.effort[index])))

    def report() -> None:
        nonlocal effort_max
        while not rospy.is_shutdown():
            time.sleep(REPORT_S)
            if newest is not None:
                index = newest.name.index(joint)
                line = {
                    "count": count,
                    "stamp_s": newest.header.stamp.to_sec(),
                    "position": newest.position[index],
                    "target": target,
                    "effort_max": effort_max,
                    "lag_s": lag_s(list(recent), float(amplitude)),
                }
                effort_max = 0.0
                print(json.dumps(line), flush=True)

    start_s, target = time.monotonic(), 0.0
    rospy.Subscriber(states, JointState, take, queue_size=1000, tcp_nodelay=True)
    threading.Thread(target=report, daemon=True).start()
    due_s = start_s
    while not rospy.is_shutdown():
        target = swing(time.monotonic() - start_s, float(amplitude))
        message = JointState(name=[joint], position=[target])
        message.header.stamp = rospy.Time.from_sec(time.time())
        publisher.publish(message)
        due_s += 1.0 / float(hz)
        time.sleep(max(0.0, due_s - time.monotonic()))


def swing(time_s: float, amplitude: float) -> float:
    """Returns where the joint is to be, which begins at rest."""
    return 0.5 * amplitude * (1.0 - math.cos(2.0 * math.pi * time_s / PERIOD_S))


def lag_s(samples: list[tuple[float, float, float]], amplitude: float) -> float:
    """Returns by how much positions of the last two seconds are behind the swing, to 2 ms."""
    rows = np.array([each[:2] for each in samples if each[0] > samples[-1][0] - PERIOD_S / 2])
    shifts = np.arange(0.0, 1.0, 0.002)
    errors = [
        np.mean((rows[:, 1] - 0.5 * amplitude * (1 - np.cos(2 * np.pi * (rows[:, 0] - shift) / PERIOD_S))) ** 2)
        for shift in shifts
    ]
    return float(shifts[int(np.argmin(errors))])


if __name__ == "__main__":
    main()
