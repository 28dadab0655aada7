"""Reads what `stamped.py` publishes: as a subscriber of ROS 1, or as a viewer of Foxglove or of the browser view."""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

from sensor_msgs.msg import JointState
from stamped import LAP_S

sys.path += [
    str(Path(__file__).resolve().parents[3] / "tests/support" / each) for each in ("screens", "network", "nodes")
]

Arrival = tuple[float, float]
"""Number of a message, and how long it took [s]."""


def of_state(state: JointState) -> Arrival:
    """Returns number and delay of a joint state that has just arrived."""
    return state.position[0], (time.monotonic_ns() - state.header.stamp.to_nsec()) * 1e-9


def read_ros1(topic: str, arrivals: list[Arrival]) -> Any:
    """Subscribes to the joint states."""
    import rospy

    rospy.init_node("door_reader", anonymous=True, disable_rostime=True, disable_signals=True)
    return rospy.Subscriber(topic, JointState, lambda state: arrivals.append(of_state(state)), tcp_nodelay=True)


def read_foxglove(topic: str, arrivals: list[Arrival], port: int) -> Any:
    """Opens the joint states as Foxglove does."""
    from foxglove_client import FoxgloveClient

    class Messages(list[Any]):
        def append(self, item: tuple[int, bytes]) -> None:
            arrivals.append(of_state(JointState().deserialize(item[1])))

    viewer = FoxgloveClient(port)
    viewer.messages[topic] = Messages()
    viewer.subscribe(topic)
    return viewer


def read_browser(arrivals: list[Arrival], link: str) -> Any:
    """Opens the page, and follows the position of the marker."""
    from viewer import Viewer

    class MarkerViewer(Viewer):
        def _apply(self, message: dict[str, Any]) -> None:
            super()._apply(message)
            if message["type"] == "SetPositionMessage" and message["name"].startswith("/time/"):
                arrivals.append((len(arrivals), (time.monotonic() - message["position"][0]) % LAP_S))

    return MarkerViewer(link)


def main() -> None:
    """Reads for some time after the first messages; prints numbers and delays [s] as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("door", choices=["ros1", "foxglove", "browser"])
    parser.add_argument("topic")
    parser.add_argument("seconds", type=float)
    parser.add_argument("address", nargs="?", default="", help="port of Foxglove, or link of the page")
    arguments = parser.parse_args()
    arrivals: list[Arrival] = []
    if arguments.door == "ros1":
        reader = read_ros1(arguments.topic, arrivals)
    elif arguments.door == "foxglove":
        reader = read_foxglove(arguments.topic, arrivals, int(arguments.address))
    else:
        reader = read_browser(arrivals, arguments.address)
    while not arrivals:
        time.sleep(0.01)
    print("ready", flush=True)
    time.sleep(1.0)
    first = len(arrivals)
    time.sleep(arguments.seconds)
    print("result:", json.dumps(arrivals[first:]))
    del reader


if __name__ == "__main__":
    main()
