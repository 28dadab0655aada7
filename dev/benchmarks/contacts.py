"""Cost of the contacts of many boxes, compared with a bare step of the same world; both alternate in one process."""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import median
from typing import Any

from physics.scene import box, box_floor, scene
from result import Result, Target

BOXES, ROWS = 200, 15
HZ = 100
TICKS = 100
"""Ticks of a turn, of which one in ten reads the contacts."""


def run(quick: bool) -> list[Result]:
    """Measures processor time, which depends little on other processes; medians over all repetitions."""
    turns = 10 if quick else 60
    with _boxes() as bare, _boxes() as silent, _boxes(contacts={"hz": HZ, "arrows_hz": 0}) as sensed:
        steps: dict[str, tuple[Callable[[], Any], list[float]]] = {
            "bare": (bare.pb.stepSimulation, []),
            "silent": (silent.step, []),
            "unseen": (sensed.step, []),
            "seen": (lambda: [sample.points for sample in sensed.step()], []),
        }
        for _ in range(turns):
            for step, times in steps.values():
                start_s = time.process_time()
                for _ in range(TICKS):
                    step()
                times.append(time.process_time() - start_s)
    us = {name: median(times) / TICKS * 1e6 for name, (_, times) in steps.items()}
    of = f"a step of {BOXES} boxes, "
    told = f"contacts at {HZ} Hz"
    return [
        Result("contacts", of + "no contacts told", us["silent"], "us", us["bare"], Target(1.1, of_floor=True)),
        Result("contacts", of + told, us["unseen"], "us", us["bare"], Target(1.2, of_floor=True)),
        Result("contacts", f"{of}{told}, each point looked at", us["seen"], "us", us["bare"]),
    ]


def _boxes(**keys: Any) -> Any:
    boxes = [
        box(f"box{index:03}", (0.05,) * 3, basePosition=[index % ROWS * 0.2, index // ROWS * 0.2, 0.05], **keys)
        for index in range(BOXES)
    ]
    return scene(collision_objects=[box_floor(5.0)], dynamic_objects=boxes)
