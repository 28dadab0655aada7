"""The view in browsers next to the demo's arm, box and camera at 1 kHz: two viewers, and a third one that stalls."""

from __future__ import annotations

import os
import re
import time
from pathlib import Path

import numpy as np
from arrivals import Arrivals
from bench_worlds import CAMERA, CONFIGS, arm_world
from result import Result, Target
from session import JOINT_STATES, Session

HZ = 1000
ARM = "kuka_lwr"
VIEWERS = 2
BOX = CONFIGS / "basic_example_kuka_lwr/box.yaml"


def run(quick: bool) -> list[Result]:
    """Measures frames, and the joint states of another subscriber; the floor is without the view, or without viewers.

    A viewer speaks the protocol of the page and draws nothing: a browser adds the time that it needs to load the page.
    """
    seconds = 8.0 if quick else 60.0
    with Session() as ros:
        ros.place_camera()
        ros.simulator(arm_world(ros.folder, HZ, dynamic_objects=[str(BOX)], rgbd_sensor=CAMERA))
        ros.program("swing_arm", f"{JOINT_STATES}/target")
        alone = ros.watch(JOINT_STATES, seconds=seconds / 2, stock=False).arrivals()[JOINT_STATES]
        node = ros.start(["rosrun", "rpbi_data", "browser_view_node.py", "_port:=0"])
        ros.wait_for_output(node, "view: ")
        link = re.findall(r"view: (\S+)", ros.output(node))[0]
        idle = processor_share(node.pid, seconds / 4)
        stalled = ros.program("page_viewer", link, ARM, 3600, "--stalled")
        ros.wait_for_output(stalled, "ready")
        viewers = []
        for _ in range(VIEWERS):
            viewers.append(ros.program("page_viewer", link, ARM, seconds + 2.0))
            ros.wait_for_output(viewers[-1], "ready")
        watcher = ros.watch(JOINT_STATES, seconds=seconds, stock=False)
        busy = processor_share(node.pid, seconds)
        beside = watcher.arrivals()[JOINT_STATES]
        seen = [ros.result_of(viewer) for viewer in viewers]
    frames = min(each["frames_hz"] for each in seen)
    return [
        Result("browser", "link opened to first arm", max(each["first_s"] for each in seen), "s", None, Target(3.0)),
        Result("browser", f"frames of each of {VIEWERS} viewers", frames, "1/s", None, Target(29.0, at_least=True)),
        Result("browser", "bytes to each viewer", max(each["kB/s"] for each in seen), "kB/s"),
        Result("browser", "joint states lost", lost(beside), "", lost(alone), Target(0.0)),
        Result("browser", "real-time factor", beside.real_time_factor, "", alone.real_time_factor, Target(0.99, True)),
        Result("browser", "real-time factor, worst second", worst_second(beside), "", worst_second(alone)),
        Result("browser", "processor of the node", busy, "", idle),
    ]


def processor_share(pid: int, seconds: float) -> float:
    """Returns the processor time a second that all threads of a process take in the next seconds [s]."""

    def spent_s() -> float:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    before_s = spent_s()
    time.sleep(seconds)
    return (spent_s() - before_s) / seconds


def lost(found: Arrivals) -> float:
    """Returns the number of ticks between the first and the last joint state that were not received."""
    ticks = np.round(found.stamp_ns * (HZ * 1e-9)).astype(np.int64)
    return float(ticks[-1] - ticks[0] + 1 - len(np.unique(ticks)))


def worst_second(found: Arrivals) -> float:
    """Returns the smallest real-time factor of a second of wall time."""
    edges = np.arange(found.arrival_s[0], found.arrival_s[-1], 1.0)
    stamps_s = found.stamp_ns[np.searchsorted(found.arrival_s, edges)] * 1e-9
    return float(np.diff(stamps_s).min())
