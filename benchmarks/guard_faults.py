"""How long after a fault the guard goes on moving a robot: 200 faults of sources, messages and the ROS master."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys

import numpy as np
from result import Result, Target
from session import PROGRAMS

COUNT, QUICK_COUNT = 200, 32


def run(quick: bool) -> list[Result]:
    """Returns the latest motion that was commanded after the faults of each kind."""
    count = QUICK_COUNT if quick else COUNT
    # in real time, where that is allowed: what is asked is when the guard stops, not when others get a processor
    realtime = ["chrt", "-f", "10"] if shutil.which("chrt") and not _fails(["chrt", "-f", "10", "true"]) else []
    program = [*realtime, sys.executable, str(PROGRAMS / "guard_faults.py"), str(count)]
    printed = subprocess.run(program, check=True, stdout=subprocess.PIPE, text=True).stdout
    line = next(line for line in printed.splitlines() if line.startswith("result: "))
    found: dict[str, list[float]] = json.loads(line.partition(": ")[2])
    latest_ms = {fault: 1e3 * np.array(each) for fault, each in sorted(found.items())}
    results = [
        Result("guard_faults", f"{fault}: latest of {len(each)}", float(each.max()), "ms", target=Target(20.0))
        for fault, each in latest_ms.items()
    ]
    late = sum(int((each > 20.0).sum()) for each in latest_ms.values())
    return [*results, Result("guard_faults", f"later than 20 ms, of {count}", late, "", target=Target(0.0))]


def _fails(command: list[str]) -> bool:
    return subprocess.run(command, check=False, capture_output=True).returncode != 0
