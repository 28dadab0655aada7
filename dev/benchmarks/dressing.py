"""Success of drawing a sleeve past people's elbows, forces on their arms, and time of retargeting."""

from __future__ import annotations

import time

import numpy as np
from result import Result, Target

from operator_node.avatar.anthropometry import segment_offsets
from operator_node.avatar.retargeting import Retargeting
from operator_node.emulators.arm_held_out import ArmHeldOut
from rpbi_examples.dressing.trial import FORCE_LIMIT_N, run_trial

SEEDS, QUICK_SEEDS = 20, 2
FRAMES = 5000
FRAME_HZ = 60


def retargeting_ms() -> float:
    """Returns how long a frame takes at the 99th percentile [ms]."""
    person, retargeting, times_s = ArmHeldOut(), Retargeting(segment_offsets(1.75)), []
    for number in range(FRAMES):
        frame = person.frame(number / FRAME_HZ)
        start_s = time.perf_counter()
        retargeting.pose(frame)
        times_s.append(time.perf_counter() - start_s)
    return float(np.percentile(times_s, 99)) * 1e3


def run(quick: bool) -> list[Result]:
    """Dresses people by seed, without ROS and as fast as possible."""
    seeds = QUICK_SEEDS if quick else SEEDS
    outcomes = [run_trial(seed) for seed in range(seeds)]
    dressed = sum(each.is_dressed and each.is_within_limits for each in outcomes)
    peak_n = max(each.peak_force_n for each in outcomes)
    wanted = Target(seeds - seeds // 20, at_least=True)
    return [
        Result("dressing", f"sleeve past the elbow within force limits, of {seeds}", dressed, "", None, wanted),
        Result("dressing", f"largest force on the arm, of {seeds}", peak_n, "N", None, Target(FORCE_LIMIT_N)),
        Result("dressing", "retargeting of a frame, p99", retargeting_ms(), "ms", None, Target(1.0)),
    ]
