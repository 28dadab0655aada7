"""Subscribes to topics and records arrival time and stamp of each message."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import rospy
from roslib.message import get_message_class

SETTLE_S = 1.0


def main() -> None:
    """Waits for every topic, prints `ready`, records for a while, and writes the records."""
    parser = argparse.ArgumentParser()
    parser.add_argument("path", help="file to write, .npz")
    parser.add_argument("seconds", type=float, help="how long to note")
    parser.add_argument("topics", nargs="+", help="TOPIC:TYPE")
    parser.add_argument(
        "--process", type=int, help="a process; the processor time of its main thread is noted with each message"
    )
    parser.add_argument("--wall", action="store_true", help="do without /clock, even if that is the time")
    arguments = parser.parse_args()
    rospy.init_node("watch", anonymous=True, disable_rostime=arguments.wall, disable_signals=True)
    noted: dict[str, list[tuple[float, Any, float]]] = {}
    processor_s = (lambda: 0.0) if arguments.process is None else partial(_processor_s, arguments.process)
    for item in arguments.topics:
        topic, _, type_name = item.partition(":")
        noted[topic] = []
        rospy.Subscriber(topic, get_message_class(type_name), _note(noted[topic], type_name, processor_s))
    while not all(noted.values()):
        time.sleep(0.01)
    print("ready")
    time.sleep(SETTLE_S)
    start_s = time.monotonic()
    time.sleep(arguments.seconds)
    end_s = time.monotonic()
    arrays = {}
    for topic, notes in noted.items():
        inside = [note for note in list(notes) if start_s <= note[0] < end_s]
        arrays[f"{topic} arrival_s"] = np.array([arrival_s for arrival_s, _, _ in inside], np.float64)
        arrays[f"{topic} stamp_ns"] = np.array([stamp.to_nsec() for _, stamp, _ in inside], np.int64)
        arrays[f"{topic} processor_s"] = np.array([spent_s for _, _, spent_s in inside], np.float64)
    np.savez(arguments.path, **arrays)


def _note(notes: list[tuple[float, Any, float]], type_name: str, processor_s: Callable[[], float]) -> Any:
    if type_name == "rosgraph_msgs/Clock":
        return lambda message: notes.append((time.monotonic(), message.clock, processor_s()))
    if type_name == "tf2_msgs/TFMessage":
        return lambda message: notes.append((time.monotonic(), message.transforms[0].header.stamp, processor_s()))
    return lambda message: notes.append((time.monotonic(), message.header.stamp, processor_s()))


def _processor_s(pid: int) -> float:
    """Returns the processor time of the main thread of a process [s]."""
    return int(Path(f"/proc/{pid}/schedstat").read_text().split()[0]) * 1e-9


if __name__ == "__main__":
    main()
