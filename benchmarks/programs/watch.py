"""Subscribes to topics and notes when each message came and what its stamp was."""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np
import rospy
from roslib.message import get_message_class

SETTLE_S = 1.0


def main() -> None:
    """Waits for every topic, says `ready`, notes for a while, writes it."""
    parser = argparse.ArgumentParser()
    parser.add_argument("path", help="file to write, .npz")
    parser.add_argument("seconds", type=float, help="how long to note")
    parser.add_argument("topics", nargs="+", help="TOPIC:TYPE")
    parser.add_argument("--wall", action="store_true", help="do without /clock, even if that is the time")
    arguments = parser.parse_args()
    rospy.init_node("watch", anonymous=True, disable_rostime=arguments.wall, disable_signals=True)
    noted: dict[str, list[tuple[float, Any]]] = {}
    for item in arguments.topics:
        topic, _, type_name = item.partition(":")
        noted[topic] = []
        rospy.Subscriber(topic, get_message_class(type_name), _note(noted[topic], type_name))
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
        arrays[f"{topic} arrival_s"] = np.array([arrival_s for arrival_s, _ in inside], np.float64)
        arrays[f"{topic} stamp_ns"] = np.array([stamp.to_nsec() for _, stamp in inside], np.int64)
    np.savez(arguments.path, **arrays)


def _note(notes: list[tuple[float, Any]], type_name: str) -> Any:
    if type_name == "rosgraph_msgs/Clock":
        return lambda message: notes.append((time.monotonic(), message.clock))
    if type_name == "tf2_msgs/TFMessage":
        return lambda message: notes.append((time.monotonic(), message.transforms[0].header.stamp))
    return lambda message: notes.append((time.monotonic(), message.header.stamp))


if __name__ == "__main__":
    main()
