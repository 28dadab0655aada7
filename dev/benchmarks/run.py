"""Runs the benchmarks, prints their figures as one table and writes them as JSON."""

from __future__ import annotations

import datetime
import importlib
import json
import os
import platform
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import results_page
from result import Result, table

BENCHMARKS = (
    *("loop", "many", "load", "camera", "latency", "free_run", "reset", "tables", "primitives"),
    *("ik", "ik_nodes", "device", "mvn", "grasp", "guard", "contacts", "physics"),
)
WHEN_NAMED = (
    *(
        "browser",
        "controls",
        "datasets",
        "doors",
        "dressing",
        "examples",
        "farm",
        "forks",
        "guard_faults",
        "gym",
        "haptics",
        "keyframes",
        "lfd",
        "live_plot",
        "passivity",
    ),
    *("plan", "press", "pushing", "recording", "soak", "streams", "teleop", "verify"),
)
"""Those that take too long to run with the others."""
FIND_RENDERER = """
from rpbi.render.camera import Intrinsics
from rpbi.render.frame import Camera
from rpbi.render.renderers import open_renderer
print("renderer:", open_renderer([Camera("camera", "camera", Intrinsics())]).name)
"""


def run(names: Sequence[str], quick: bool = False, json_file: Path | None = None, page: bool = False) -> int:
    """Runs benchmarks.

    Args:
        names: Their names, of BENCHMARKS or WHEN_NAMED; without any, those of BENCHMARKS.
        quick: Whether to measure for a shorter time, less exactly.
        json_file: File for the figures.
        page: Whether to keep the figures and write docs/results.md.

    Returns:
        The exit code: 1 if one could not run.
    """
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that started processes end, too
    facts = machine()
    results: list[Result] = []
    failed = []
    for name in names or BENCHMARKS:
        print(f"==> {name}", file=sys.stderr, flush=True)
        start_s = time.monotonic()
        try:
            measured = importlib.import_module(name).run(quick)
            results += measured
            if page:
                results_page.keep(name, measured, facts, quick)
        except Exception:
            traceback.print_exc()
            failed.append(name)
        print(f"    {time.monotonic() - start_s:.0f} s", file=sys.stderr, flush=True)
    print("\n".join(f"{key}: {value}" for key, value in facts.items()), table(results), sep="\n\n")
    if json_file:
        report = {"machine": facts, "quick": quick, "results": [one.as_dict() for one in results]}
        json_file.write_text(json.dumps(report, indent=2) + "\n")
    if page:
        results_page.write()
    if failed:
        print(f"could not run: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


def machine() -> dict[str, Any]:
    """Returns the properties of the machine and of the workspace that figures depend on."""
    describe = ("git", "describe", "--always", "--dirty", "--abbrev=10")
    commit = subprocess.run(describe, cwd=Path(__file__).parent, capture_output=True, text=True).stdout.strip()
    return {
        "date": datetime.date.today().isoformat(),
        "commit": commit or "unknown",
        "cores": os.cpu_count(),
        "processor": _processor(),
        "load_average": round(os.getloadavg()[0], 2),
        "python": platform.python_version(),
        "pybullet": version("pybullet"),
        "renderer": _renderer(),
    }


def _processor() -> str:
    path = Path("/proc/cpuinfo")
    lines = path.read_text().splitlines() if path.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


def _renderer() -> str:
    """Returns the name of the renderer; it is requested in its own process, since some drivers end the process."""
    found = subprocess.run([sys.executable, "-c", FIND_RENDERER], capture_output=True, text=True)
    # PyBullet and its plugin print a lot around it
    names = [line.partition(": ")[2] for line in found.stdout.splitlines() if line.startswith("renderer: ")]
    return names[0] if names else "none"
