"""An operator on another computer: swings a joint by targets, others stay, and prints what comes back, as JSON lines.

Arguments: the topic of joint states, the topic of targets, the joint, targets a second and the swing's amplitude [rad].
Lines have the number of joint states so far, the stamp of the newest [s], its position, the newest target and the
largest effort since the last line; `lag_s` is how far positions are behind the swing, on average over two seconds.
"""

from __future__ import annotations

import json
import math
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
    rospy.init_node("operator")
    publisher = rospy.Publisher(targets, JointState, queue_size=100, tcp_nodelay=True)
    recent: deque[tuple[float, float]] = deque(maxlen=4000)
    count, newest, effort_max = 0, None, 0.0

    def on_message(message: JointState) -> None:
        nonlocal count, newest, effort_max
        index = message.name.index(joint)
        count += 1
        newest = message
        effort_max = max(effort_max, abs(message.effort[index]))
        recent.append((time.monotonic() - start_s, message.position[index] - begin))

    def report() -> None:
        nonlocal effort_max
        while not rospy.is_shutdown():
            time.sleep(REPORT_S)
            if newest is not None and recent:
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

    start_s, begin, target = time.monotonic(), 0.0, 0.0  # until the first target
    rospy.Subscriber(states, JointState, on_message, queue_size=1000, tcp_nodelay=True)
    threading.Thread(target=report, daemon=True).start()
    while newest is None and not rospy.is_shutdown():
        time.sleep(0.01)
    names, others = newest.name, list(newest.position)
    begin = others[names.index(joint)]
    recent.clear()
    start_s = due_s = time.monotonic()
    stamp = rospy.Time()
    while not rospy.is_shutdown():
        target = begin + swing(time.monotonic() - start_s, float(amplitude))
        position = [target if name == joint else value for name, value in zip(names, others, strict=True)]
        message = JointState(name=names, position=position)
        message.header.stamp = rospy.get_rostime()
        if message.header.stamp > stamp:  # simulated time may come late, and stand still meanwhile
            publisher.publish(message)
            stamp = message.header.stamp
        due_s += 1.0 / float(hz)
        time.sleep(max(0.0, due_s - time.monotonic()))


def swing(time_s: float, amplitude: float) -> float:
    """Returns where the joint is to be, which begins at rest."""
    return 0.5 * amplitude * (1.0 - math.cos(2.0 * math.pi * time_s / PERIOD_S))


def lag_s(samples: list[tuple[float, float]], amplitude: float) -> float:
    """Returns by how much positions of the last two seconds are behind the swing, to 2 ms."""
    rows = np.array([each for each in samples if each[0] > samples[-1][0] - PERIOD_S / 2])
    shifts = np.arange(0.0, 1.0, 0.002)
    errors = [
        np.mean((rows[:, 1] - 0.5 * amplitude * (1 - np.cos(2 * np.pi * (rows[:, 0] - shift) / PERIOD_S))) ** 2)
        for shift in shifts
    ]
    return float(shifts[int(np.argmin(errors))])


if __name__ == "__main__":
    main()
