"""How long `rpbi/reset` takes for the KUKA scene, compared with loading it, and the cost of the hash of a state."""

from __future__ import annotations

import json
import subprocess
import sys

import yaml
from bench_worlds import CONFIGS
from result import Result, Target
from session import JOINT_STATES, PROGRAMS, Session

RESETS, QUICK_RESETS = 1000, 50
TARGET_MS = 200.0


def run(quick: bool) -> list[Result]:
    """Resets the running scene again and again, with a TF listener, a recorder and a controller attached.

    Args:
        quick: Whether fewer resets will do.
    """
    resets = QUICK_RESETS if quick else RESETS
    main = CONFIGS / "basic_example_kuka_lwr" / "config.yaml"
    with Session() as ros:
        ros.simulator(yaml.safe_load(main.read_text()))
        ros.start(["rosbag", "record", "-O", str(ros.folder / "resets.bag"), "/tf", "/clock", JOINT_STATES])
        program = ros.program("reset_often", resets)
        found = ros.result_of(program)
        told = [line for line in ros.output(program).splitlines() if "warning: " in line or "TF_" in line]
    print("\n".join(told), end="", file=sys.stderr)
    alone = subprocess.run(
        [sys.executable, str(PROGRAMS / "reset_alone.py"), str(main)], capture_output=True, text=True, check=True
    )
    line = next(line for line in alone.stdout.splitlines() if line.startswith("result: "))
    floor = json.loads(line.partition(": ")[2])
    return [
        Result("reset", f"median of {resets} resets", found["median_ms"], "ms", floor["load_ms"], Target(TARGET_MS)),
        Result("reset", f"slowest of {resets} resets", found["slowest_ms"], "ms"),
        Result("reset", f"memory added by {resets} resets", found["grown_mb"], "MB more", None, Target(5.0)),
        Result("reset", f"threads and files added by {resets} resets", found["grown_handles"], "more", None, Target(0)),
        Result("reset", f"warnings during {resets} resets", len(told), "", None, Target(0)),
        Result("reset", "hash of the state", floor["hash_us"], "us", floor["tick_us"]),
    ]
