"""Simulated seconds a second of the scenes, from their launch files."""

from __future__ import annotations

import re
import subprocess

from result import Result, Target
from session import Session

from rpbi_examples.scenes import SCENES

EPISODES, QUICK_EPISODES = 3, 1
FIRST_SEED = 1
LEAST_FACTOR = 0.95
LONGEST_S = 600.0
"""Longest time of a launch [s]."""
FACTOR = re.compile(r"seed \d+ (\w+).*real-time factor: ([\d.]+)")


def run(quick: bool) -> list[Result]:
    """Runs episodes of each scene in real time."""
    return [each for name in SCENES for each in _scene(name, QUICK_EPISODES if quick else EPISODES)]


def _scene(name: str, episodes: int) -> list[Result]:
    with Session() as ros:
        arguments = [f"seed:={FIRST_SEED}", f"episodes:={episodes}", "headless:=true"]
        process = ros.start(["roslaunch", "rpbi_examples", f"{name}.launch", *arguments])
        try:
            process.wait(LONGEST_S)
        except subprocess.TimeoutExpired:
            print(f"{name}: not done after {LONGEST_S:g} s")
        found = FACTOR.findall(ros.output(process))
    least = min((float(factor) for _, factor in found), default=0.0)
    return [
        Result("examples", f"{name}: real-time factor", least, "", None, Target(LEAST_FACTOR, at_least=True)),
        Result("examples", f"{name}: succeeded, of {episodes}", sum(each == "succeeded" for each, _ in found), ""),
    ]
