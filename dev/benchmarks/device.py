"""From a device's event to `joy`, and by a mapping to `operator_node/signal`; the floor is a rospy echo of `joy`."""

from __future__ import annotations

import numpy as np
import roslib.packages
from result import Result, Target
from session import Session

ROUNDS = 4
"""Echo, device and mapping alternate, so that the load of the computer affects all equally."""
JOY, SIGNAL = "/joy", "/operator_node/signal"
SENT, ECHOED = "/sent", "/echoed"
OPTIONS = ("_full_scale:=1000", "_static_count_threshold:=1000", "_autorepeat_rate:=0")


def run(quick: bool) -> list[Result]:
    """Measures p50 and p99 with the emulated 6-D mouse."""
    count = 50 if quick else 250
    topics = [JOY]
    with Session(use_sim_time=False) as ros:
        path = str(ros.folder / "spnav.sock")
        ros.program("echo", SENT, ECHOED, "sensor_msgs/Joy")
        ros.start(["rosrun", "operator_node", "spacenav_node.py", f"_socket:={path}", *OPTIONS])
        if roslib.packages.find_node("operator_node", "scale_node.py"):
            mapping = ["_config:={axes_idx: [0]}", "_start_on_init:=true"]
            ros.start(["rosrun", "operator_node", "scale_node.py", *mapping])
            topics.append(SIGNAL)
        found: dict[str, list[float]] = {topic: [] for topic in (ECHOED, *topics)}
        for _ in range(ROUNDS):
            found[ECHOED] += ros.result_of(ros.program("device_events", ECHOED, count, "--echo", SENT))
            for topic in topics:
                found[topic] += ros.result_of(ros.program("device_events", topic, count, "--socket", path))
    floor50, floor99 = (float(np.percentile(found[ECHOED], p)) * 1e3 for p in (50, 99))
    results = []
    for topic in topics:
        p50, p99 = (float(np.percentile(found[topic], p)) * 1e3 for p in (50, 99))
        target = Target(5.0) if p99 <= 5.0 else Target(3.0, of_floor=True)
        results += [
            Result("device", f"event to {topic[1:]} p50", p50, "ms", floor50),
            Result("device", f"event to {topic[1:]} p99", p99, "ms", floor99, target),
        ]
    return results
