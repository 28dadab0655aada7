"""The guard fails closed: sources that die or say nonsense, and a master that dies, move nothing any more.

More and other faults: `./rpbi bench guard_faults`.
"""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from safe_robot.target_queue import TargetQueue

PROGRAM = Path(__file__).resolve().parents[3] / "dev/benchmarks/programs/guard_faults.py"
SOON_S = 0.15
"""Shorter than the time that the program looks on after a fault; a busy machine takes more than the guard's 20 ms."""
SEED = 53
"""With it the robot is fast when the faults come after which it brakes: where it turns round, nothing is to brake."""
TRIES = 4
"""A machine that stands still while the program looks on shows nothing, so that fault is tried again."""


def outcomes(faults: Sequence[str], *options: str) -> dict[str, tuple[float, float]]:
    """Returns by fault how long after it the last motion was commanded that is no braking, and the last of all [s]."""
    command = [sys.executable, str(PROGRAM), str(len(faults)), *options, "--faults", *faults]
    printed = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, timeout=300.0).stdout
    line = next(line for line in printed.splitlines() if line.startswith("result: "))
    return {fault: tuple(each) for fault, (each,) in json.loads(line.partition(": ")[2]).items()}


def still(faults: Sequence[str], is_bad: Callable[[float, float], bool], *options: str) -> dict[str, object]:
    """Returns the faults after which the outcome was bad each time, and what it was [s]."""
    bad: dict[str, object] = {}
    for attempt in range(TRIES):
        found = outcomes(faults, "--seed", str(SEED + attempt), *options)
        assert sorted(found) == sorted(faults)
        bad = {fault: each for fault, each in found.items() if is_bad(*each)}
        faults = [*bad]
        if not faults:
            break
    return bad


def goes_on(followed_s: float, _: float) -> bool:
    return followed_s > SOON_S


def does_not_brake(followed_s: float, moved_s: float) -> bool:
    return followed_s > SOON_S or not moved_s > followed_s


def test_only_braking_follows_a_fault_and_more_without_a_guard(ros_master):
    assert not still(("NaN", "burst, SIGSTOP", "stamps jump ahead"), goes_on)
    assert not still(("late input", "kill -9", "master killed"), does_not_brake, "--on-halt", "brake")
    assert not still(("NaN", "late input"), lambda *outcome: not goes_on(*outcome), "--unguarded")


def test_replacement_commands_are_sent_one_period_apart():
    """However late it is: what is late is not caught up with, and what waited is dropped."""
    period_s, taken = 0.02, []
    times_s: list[float] = []
    done = threading.Event()

    def accept(item: int) -> bool:
        taken.append(item)
        times_s.append(time.monotonic())
        return True

    def step() -> bool:
        times_s.append(time.monotonic())
        time.sleep(0.05 if len(times_s) == 3 else 0.0)
        if len(times_s) == 8:
            done.set()
        return len(times_s) < 8

    queue = TargetQueue(period_s, 60.0, 100, accept, lambda age_s: None)
    with queue.lock:
        for item in range(4):
            queue.put(item, 0.0)
        queue.run_instead(step)
    assert done.wait(60.0) and taken == [0]
    assert np.diff(times_s).min() >= period_s - 1e-3, "but for what lies between the begin of a period and the call"


@pytest.mark.parametrize("silence_s, is_dropped", [(0.12, True), (60.0, False)])
def test_targets_left_by_a_dead_source_are_not_sent(silence_s, is_dropped):
    taken: list[int] = []
    given_up = threading.Event()
    done = threading.Event()

    def accept(item: int) -> bool:
        taken.append(item)
        if item == 9:
            done.set()
        return True

    queue = TargetQueue(0.05, silence_s, 100, accept, lambda age_s: given_up.set())
    for item in range(10):
        queue.put(item, 0.0)
    assert (given_up if is_dropped else done).wait(60.0)
    assert taken == list(range(len(taken)))
    assert given_up.is_set() == is_dropped == (len(taken) < 10)
