"""Jitter of the 1 kHz loop of a haptic device while the simulator runs; the reference is a bare loop with the
simulator.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np
from result import Result, Target
from session import PROGRAMS, Session

PERIOD_S = 1e-3
START_S = 10.0
"""Time in which programs are still starting [s]."""


def run(quick: bool) -> list[Result]:
    """Measures how far the times between ticks are from 1 ms while a hand presses an arm on a box."""
    seconds = 20.0 if quick else 600.0
    with Session(use_sim_time=False) as ros:
        haptic, bare = ros.folder / "haptic.npy", ros.folder / "bare.npy"
        path = f"{PROGRAMS}:{os.environ.get('PYTHONPATH', '')}"
        arguments = ["device:=timed_hand:TimedHand", f"device_options:={{file: {haptic}}}", "headless:=true"]
        launch = ["roslaunch", "rpbi_examples", "human_interaction.launch", *arguments, f"output:={ros.folder}"]
        example = ros.start(["env", f"PYTHONPATH={path}", *launch])
        floor = ros.program("bare_loop", bare)
        ros.watch("/rpbi/kuka_lwr/joint_states", seconds=0.1)
        time.sleep(START_S + seconds)
        ros.stop(example)
        ros.stop(floor)
        if not haptic.exists():
            raise RuntimeError(f"the haptic node left no file:\n{ros.output(example)}")
        late, floor_late = (_jitter_ms(file, seconds) for file in (haptic, bare))
    results = []
    for share in (50.0, 99.0, 99.9):
        figure = f"p{share:g} off 1 ms in {seconds:g} s"
        found, least = (float(np.percentile(each, share)) for each in (late, floor_late))
        results.append(Result("haptics", figure, found, "ms", least, Target(1.0) if share == 99.9 else None))
    results.append(Result("haptics", "ticks a second", len(late) / seconds, "Hz", len(floor_late) / seconds))
    return results


def _jitter_ms(file: Path, seconds: float) -> np.ndarray:
    """Returns the differences of the times between ticks from the period, in the last seconds of a file [ms]."""
    times = np.load(file)
    times = times[times > times[-1] - seconds]
    return np.abs(np.diff(times) - PERIOD_S) * 1e3
