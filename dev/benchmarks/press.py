"""Whether the force of an arm that presses on a box is the one that stiffness and depth predict, for each seed."""

from __future__ import annotations

import re
import sys
from pathlib import Path

from result import Result, Target
from session import Session

SEEDS, QUICK_SEEDS = 20, 2
LARGEST_ERROR = 0.05
"""Largest error of the mean force on the tool, as a share of the predicted force."""
LONGEST_S = 180.0
MEANS = re.compile(
    r"at a depth of ([\d.]+) mm: ([\d.]+) N on the tool, by stiffness ([\d.]+) N .* scattered by ([\d.]+) N; "
    r"(-?[\d.]+) N on the handle, by scale ([\d.]+) N"
)
ROW = "{:>4}  {:>10}  {:>10}  {:>13}  {:>7}  {:>11}  {:>12}  {:>9}"
HEADING = ROW.format(
    "seed", "depth [mm]", "mean [N]", "predicted [N]", "off [%]", "scatter [N]", "on handle [N]", "off [%]"
)


def run(quick: bool) -> list[Result]:
    """Launches `human_interaction.launch` with a scripted hand, once for each seed, and reads its output."""
    seeds = QUICK_SEEDS if quick else SEEDS
    errors: list[float] = []
    print(HEADING, file=sys.stderr)
    for seed in range(seeds):
        with Session(use_sim_time=False) as ros:
            output = press(ros, seed, ros.folder)
        found = MEANS.search(output)
        if not found:
            said = [line for line in output.splitlines() if "[FATAL]" in line or "Error" in line]
            print(f"{seed:>4}  no force: {'; '.join(said) or output}", file=sys.stderr, flush=True)
            continue
        depth_mm, mean_n, predicted_n, scatter_n, felt_n, scaled_n = map(float, found.groups())
        errors.append(abs(mean_n - predicted_n) / predicted_n)
        off, felt_off = f"{100 * errors[-1]:.1f}", f"{100 * abs(felt_n - scaled_n) / scaled_n:.1f}"
        print(
            ROW.format(seed, depth_mm, mean_n, predicted_n, off, scatter_n, felt_n, felt_off),
            file=sys.stderr,
            flush=True,
        )
    passed = sum(error <= LARGEST_ERROR for error in errors)
    wanted = Target(seeds - seeds // 20, at_least=True)
    return [
        Result("press", f"mean force within {LARGEST_ERROR:.0%}, of {seeds}", passed, "", None, wanted),
        *([Result("press", f"largest error, of {len(errors)}", 100 * max(errors), "%")] if errors else []),
    ]


def press(ros: Session, seed: int, folder: Path) -> str:
    """Runs one press to its end and returns its output."""
    arguments = ["device:=scripted", f"seed:={seed}", "headless:=true", f"output:={folder}"]
    process = ros.start(["roslaunch", "rpbi_examples", "human_interaction.launch", *arguments])
    process.wait(LONGEST_S)
    return ros.output(process)
