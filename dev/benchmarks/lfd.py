"""Whether a box is at its goal after a demonstrated push: scripted, and by real keys in a window."""

from __future__ import annotations

import contextlib
import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

from result import Result, Target
from session import Session
from virtual_screen import virtual_screen

FIRST_SEED = 100
"""Seeds from here on were not used while the example was written."""
SCRIPTED, KEYBOARD, QUICK = 20, 10, 1
LONGEST_S = 300.0
ROW = "{:<9} {:>5}  {:>15}  {:>14}  {:>14}"
HEADING = ROW.format("operator", "seed", "start [mm]", "shown", "executed")


def run(quick: bool) -> list[Result]:
    """Launches `lfd.launch` once for each seed, with a demonstration and an execution of its own."""
    print(HEADING, file=sys.stderr)
    scripted = [_session(seed, "scripted", {}) for seed in _seeds(QUICK if quick else SCRIPTED)]
    with virtual_screen(800, 600) as display:
        keyboard = [_session(seed, "keyboard", {"DISPLAY": display}) for seed in _seeds(QUICK if quick else KEYBOARD)]
    return [*_results("scripted", scripted, 0.95), *_results("keyboard", keyboard, 0.9)]


def _seeds(count: int) -> range:
    return range(FIRST_SEED, FIRST_SEED + count)


def _results(name: str, runs: list[dict[str, Any] | None], share: float) -> list[Result]:
    done = [each for each in runs if each is not None]
    at_goal, wanted = sum(each["at_goal"] for each in done), Target(math.ceil(share * len(runs)), at_least=True)
    found = [Result("lfd", f"{name}: box within 30 mm and 10 deg, of {len(runs)}", at_goal, "", None, wanted)]
    for key, unit, factor in (("box_error_m", "mm", 1000.0), ("box_error_deg", "deg", 1.0)):
        if done:
            largest = max(each[key] for each in done) * factor
            found.append(Result("lfd", f"{name}: farthest from the goal, of {len(done)}", largest, unit))
    return found


def _session(seed: int, operator: str, environment: dict[str, str]) -> dict[str, Any] | None:
    """Returns the entry of the execution in summary.json; None without one."""
    with Session() as ros:
        out = ros.folder / "lfd"
        arguments = [f"operator:={operator}", f"seed:={seed}", "rounds:=1", "headless:=true", f"out:={out}"]
        process = ros.start(["roslaunch", "rpbi_examples", "lfd.launch", *arguments], **environment)
        if operator == "keyboard":
            person = ["rosrun", "rpbi_examples", "lfd_person.py", "_window:=true", f"_seed:={seed}"]
            ros.start(person, **environment)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(LONGEST_S)
        summary = out / "summary.json"
        if not summary.exists():
            faults = [line for line in ros.output(process).splitlines() if "[FATAL]" in line or "[ERROR]" in line]
            print(f"{operator:<9} {seed:>5}  {'; '.join(faults) or 'no execution'}", file=sys.stderr, flush=True)
            return None
        return _row(seed, operator, summary)


def _row(seed: int, operator: str, path: Path) -> dict[str, Any]:
    summary = json.loads(path.read_text())
    shown, executed = summary["demonstrations"][-1], summary["executions"][-1]
    start = ", ".join(f"{1000.0 * each:.0f}" for each in executed["start"])
    errors = (f"{1000.0 * each['box_error_m']:.1f} mm {each['box_error_deg']:.1f}" for each in (shown, executed))
    print(ROW.format(operator, seed, start, *errors), file=sys.stderr, flush=True)
    return dict(executed)
