"""Processor time to receive people from MVN and publish them; the reference is a bare loop that only receives."""

from __future__ import annotations

import os
import socket
import subprocess
import time
from pathlib import Path

from result import Result, Target
from session import Session

HZ = 240
PEOPLE = (1, 3)
TOPICS = ("/tf", "/mvn/segments")
MAX_PERCENT = 25.0
"""Share of a core that one person may take."""


def run(quick: bool) -> list[Result]:
    """Measures the processor time of `mvn_node.py`, with a subscriber of TF and poses, at 240 frames a second."""
    seconds = 3.0 if quick else 15.0
    results = []
    for people in PEOPLE:
        with Session(use_sim_time=False) as ros:
            ports = [_free_port() for _ in range(2)]
            node = ros.start(["rosrun", "operator_node", "mvn_node.py", f"_port:={ports[0]}"])
            floor = ros.program("receive", ports[1])
            for port in ports:
                options = ["--port", str(port), "--hz", str(HZ), "--people", str(people)]
                ros.start(["rosrun", "operator_node", "mvn_emulator.py", *options])
            watcher = ros.watch(*TOPICS, seconds=seconds)
            before = [_processor_s(process) for process in (node, floor)]
            begin_s = time.monotonic()
            arrivals = watcher.arrivals()
            passed_s = time.monotonic() - begin_s
            node_s, floor_s = (_processor_s(each) - was for each, was in zip((node, floor), before))
        target = Target(MAX_PERCENT) if people == 1 else None
        share, floor_share = (100.0 * used_s / passed_s for used_s in (node_s, floor_s))
        what = f"{people} at {HZ} Hz"
        results.append(Result("mvn", f"{what}: share of a core", share, "%", floor_share or None, target))
        poses = arrivals["/mvn/segments"].rate_hz
        results.append(Result("mvn", f"{what}: poses of the first person", poses, "Hz", HZ))
    return results


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _processor_s(process: subprocess.Popen[bytes]) -> float:
    """Returns how much processor time a process has had [s]."""
    fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
