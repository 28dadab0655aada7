"""Time after a fault for which the guard still moves a robot: 200 faults of sources, messages, time and the ROS
master.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys

import numpy as np
from result import Result, Target
from session import PROGRAMS

LATEST_MS = 20.0
VARIANTS = {
    "reject": ((), 0.35),
    "reject, /clock": (("--simulated-time",), 0.1),
    "limit": (("--policy", "limit"), 0.2),
    "limit, /clock": (("--policy", "limit", "--simulated-time"), 0.05),
    "brake": (("--on-halt", "brake"), 0.25),
    "brake, /clock": (("--on-halt", "brake", "--simulated-time"), 0.05),
}
"""Methods of stopping the guard, and their shares of the faults."""
COUNT, QUICK_COUNT = 200, 40


def run(quick: bool) -> list[Result]:
    """Returns the latest motion that was commanded after the faults of each kind, but for a braking to rest."""
    count = QUICK_COUNT if quick else COUNT
    results, late = [], 0
    for variant, (options, share) in VARIANTS.items():
        for fault, outcomes_ms in sorted(_outcomes_ms(round(share * count), options).items()):
            followed, moved = outcomes_ms.max(axis=0)
            late += int((outcomes_ms[:, 0] > LATEST_MS).sum())
            name = f"{variant}: {fault}, {len(outcomes_ms)} times"
            results.append(Result("guard_faults", f"{name}: motion", followed, "ms", target=Target(LATEST_MS)))
            if moved > followed:
                results.append(Result("guard_faults", f"{name}: end of braking", moved, "ms"))
    return [*results, Result("guard_faults", f"motion later than 20 ms, of {count}", late, "", target=Target(0.0))]


def _outcomes_ms(count: int, options: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Returns by fault when the last motion was, and the last braking, n x 2 [ms] after it."""
    # with real-time priority if permitted: the time of the guard is measured, not that of the scheduler
    realtime = ["chrt", "-f", "10"] if shutil.which("chrt") and not _fails(["chrt", "-f", "10", "true"]) else []
    program = [*realtime, sys.executable, str(PROGRAMS / "guard_faults.py"), str(count), *options]
    printed = subprocess.run(program, check=True, stdout=subprocess.PIPE, text=True).stdout
    line = next(line for line in printed.splitlines() if line.startswith("result: "))
    found: dict[str, list[list[float]]] = json.loads(line.partition(": ")[2])
    return {fault: 1e3 * np.array(each) for fault, each in found.items()}


def _fails(command: list[str]) -> bool:
    return subprocess.run(command, check=False, capture_output=True).returncode != 0
