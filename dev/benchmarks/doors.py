"""Delay from a publisher of ROS 1 at 1 kHz to viewers: ROS 1, a browser, Foxglove and ROS 2, one after the other.

The floor is a ROS 1 subscriber in the same seconds.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from result import Result
from session import PROGRAMS, Session

from custom_ros_tools.ros.lifecycle.timed_master import unused_port

sys.path.append(str(Path(__file__).resolve().parents[2] / "tests/support/nodes"))
TOPIC, MARKER = "/arm/joint_states", "/marker"
DOMAIN = 77
Reader = subprocess.Popen[bytes]


def run(quick: bool) -> list[Result]:
    """Measures delays and losses through each door. Without Python 3.12, ROS 2 is left out.

    Through Foxglove and ROS 2 each joint state is measured. The page in a browser shows a marker, which is published 10
    times a second: its delay contains the wait for the page's next frame, but not the time that a browser draws.
    """
    seconds = 5.0 if quick else 60.0
    doors: list[Callable[[Session, float], Reader]] = [_browser, _foxglove]
    if (folder := _ros2_folder()) is not None:
        doors.append(lambda ros, seconds: _ros2(ros, seconds, folder))
    names = ("browser", "Foxglove", "ROS 2")
    return [result for name, door in zip(names, doors) for result in _through(name, door, seconds)]


def _through(name: str, door: Callable[[Session, float], Reader], seconds: float) -> list[Result]:
    with Session(use_sim_time=False) as ros:
        ros.program("stamped", TOPIC, MARKER)
        there = door(ros, seconds)
        ros.wait_for_output(there, "ready")
        here = ros.program("door_reader", "ros1", TOPIC, seconds)
        ros.wait_for_output(here, "ready")
        seen, floor = (np.array(ros.result_of(each)) for each in (there, here))
    found, least = seen[:, 1] * 1e3, floor[:, 1] * 1e3
    results = [
        Result("doors", f"{name}, {figure}", float(np.percentile(found, p)), "ms", float(np.percentile(least, p)))
        for figure, p in (("median", 50), ("p99", 99))
    ]
    if name != "browser":
        lost = seen[-1, 0] - seen[0, 0] + 1 - len(seen)
        results.append(Result("doors", f"{name}, lost of {len(seen)}", float(lost), ""))
    return results


def _browser(ros: Session, seconds: float) -> Reader:
    node = ros.start(["rosrun", "rpbi_data", "browser_view_node.py", "_port:=0"])
    ros.wait_for_output(node, "view: ")
    (link,) = re.findall(r"view: (\S+)", ros.output(node))
    return ros.program("door_reader", "browser", TOPIC, seconds, link)


def _foxglove(ros: Session, seconds: float) -> Reader:
    port = unused_port()
    node = ros.start(["rosrun", "rpbi_utils", "foxglove_node.py", "--port", str(port)])
    ros.wait_for_output(node, "can connect to")
    return ros.program("door_reader", "foxglove", TOPIC, seconds, port)


def _ros2(ros: Session, seconds: float, folder: Path) -> Reader:
    from ros2_system import ros2_environment

    node = ros.start(["rosrun", "rpbi_ros2", "ros2_bridge_node.py", f"_domain_id:={DOMAIN}"])
    ros.wait_for_output(node, "ROS 2: topics")
    command = [f"{folder}/bin/python", "-u", str(PROGRAMS / "ros2_reader.py"), TOPIC, str(seconds)]
    return ros.start(command, **ros2_environment(DOMAIN, folder))


def _ros2_folder() -> Path | None:
    """Returns the virtual environment with ROS 2 that the tests use; None without Python 3.12."""
    import pytest
    from ros2_system import ros2_folder

    try:
        return ros2_folder()
    except pytest.skip.Exception as reason:
        print(f"ROS 2 is left out: {reason}", file=sys.stderr)
        return None
