"""Time in which movement primitives are learned from demonstrations, and in which they plan."""

from __future__ import annotations

import time

import numpy as np
from result import Result, Target

from motion_primitives import Demonstration, make_primitive

DEMONSTRATIONS, SECONDS, HZ = 5, 10.0, 100
LIMIT_S = 1.0
REPEATS = 5


def run(quick: bool) -> list[Result]:
    """Learns motions with orientation, five of 10 s at 100 Hz; the longest time of five."""
    shown = [_shown(number) for number in range(DEMONSTRATIONS)]
    results = []
    for name in ("dmp", "promp", "rhythmic_dmp"):
        learning, planning = [], []
        for _ in range(1 if quick else REPEATS):
            start_s = time.perf_counter()
            primitive = make_primitive(name, {}).learn(shown)
            learned_s = time.perf_counter()
            primitive.plan()
            planning.append(time.perf_counter() - learned_s)
            learning.append(learned_s - start_s)
        figure = f"{name}: learning from {DEMONSTRATIONS} demonstrations of {SECONDS:g} s"
        results.append(Result("primitives", figure, max(learning), "s", None, Target(LIMIT_S)))
        results.append(Result("primitives", f"{name}: plan", max(planning), "s"))
    return results


def _shown(number: int) -> Demonstration:
    """Returns a motion to and fro, twice in its time, that differs from demonstration to demonstration."""
    times = np.linspace(0.0, SECONDS, round(SECONDS * HZ) + 1)
    turn = 4.0 * np.pi * times / SECONDS
    size = 1.0 + 0.05 * number
    positions = size * np.stack([0.3 * np.sin(turn), 0.2 * np.cos(turn), 0.3 + 0.1 * np.sin(2.0 * turn)], axis=1)
    angle = 0.4 * size * np.sin(turn)
    quats = np.stack([0.0 * angle, 0.0 * angle, np.sin(angle / 2.0), np.cos(angle / 2.0)], axis=1)
    return Demonstration.of(times, positions, quats)
