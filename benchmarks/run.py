"""Runs the benchmarks, prints their figures as one table and writes them as JSON."""

from __future__ import annotations

import argparse
import importlib
import json
import os
import platform
import signal
import subprocess
import sys
import time
import traceback
from importlib.metadata import version
from pathlib import Path
from typing import Any

from result import Result, table

BENCHMARKS = (
    *("loop", "many", "load", "camera", "latency", "free_run", "reset", "tables"),
    *("ik", "ik_nodes", "device", "mvn", "grasp", "guard", "contacts", "physics"),
)
WHEN_NAMED = ("dressing", "guard_faults", "haptics", "passivity", "press", "soak", "streams", "teleop")
"""Those that take too long to run with the others."""
FIND_RENDERER = """
from rpbi.render.camera import Intrinsics
from rpbi.render.frame import Camera
from rpbi.render.renderers import open_renderer
print("renderer:", open_renderer([Camera("camera", "camera", Intrinsics())]).name)
"""


def main() -> None:
    """Runs the benchmarks named on the command line, all without names; exits with 1 if one could not run."""
    parser = argparse.ArgumentParser(prog="benchmarks", description=__doc__)
    default, named = ", ".join(BENCHMARKS), ", ".join(WHEN_NAMED)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"by default all of {default}; also {named}")
    parser.add_argument("--json", type=Path, metavar="FILE", help="where to write the figures")
    parser.add_argument("--quick", action="store_true", help="measure for a shorter time, less exactly")
    arguments = parser.parse_args()
    for name in arguments.names:
        if name not in BENCHMARKS + WHEN_NAMED:
            parser.error(f"there is no benchmark '{name}'; there are {', '.join(BENCHMARKS + WHEN_NAMED)}")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that what was started ends too
    facts = machine()
    results: list[Result] = []
    failed = []
    for name in arguments.names or BENCHMARKS:
        print(f"==> {name}", file=sys.stderr, flush=True)
        start_s = time.monotonic()
        try:
            results += importlib.import_module(name).run(arguments.quick)
        except Exception:
            traceback.print_exc()
            failed.append(name)
        print(f"    {time.monotonic() - start_s:.0f} s", file=sys.stderr, flush=True)
    print("\n".join(f"{key}: {value}" for key, value in facts.items()), table(results), sep="\n\n")
    if arguments.json:
        report = {"machine": facts, "quick": arguments.quick, "results": [one.as_dict() for one in results]}
        arguments.json.write_text(json.dumps(report, indent=2) + "\n")
    if failed:
        sys.exit(f"could not run: {', '.join(failed)}")


def machine() -> dict[str, Any]:
    """Returns what the figures depend on."""
    return {
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
    """Returns what draws the images; asked in a process of its own, since some drivers end it."""
    found = subprocess.run([sys.executable, "-c", FIND_RENDERER], capture_output=True, text=True)
    # PyBullet and its plugin print a lot around it
    names = [line.partition(": ")[2] for line in found.stdout.splitlines() if line.startswith("renderer: ")]
    return names[0] if names else "none"
