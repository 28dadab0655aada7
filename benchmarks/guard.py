"""How long the guard takes for a decision on a seven-joint arm, with all checks of joints and shapes."""

from __future__ import annotations

import math
import time
from pathlib import Path

import numpy as np
from result import Result, Target

from rpbi.geometry import Pose
from safe_robot.check import Situation
from safe_robot.config import GuardConfig
from safe_robot.geometry.obstacles import Obstacle
from safe_robot.guard import Guard
from safe_robot.robot import GuardedRobot

LWR = Path(__file__).resolve().parent.parent / "src/rpbi_examples/robots/kuka_lwr.urdf"
PERIOD_S = 0.002
DECISIONS, QUICK_DECISIONS = 20_000, 2_000
HOME = np.array((0.0, 0.5, 0.0, -1.2, 0.0, 0.8, 0.0))
SPEEDS = np.array((0.7, 0.9, 1.1, 1.3, 1.7, 1.9, 2.3))
"""Frequencies at which the joints swing [rad/s]."""
CHECKS = {
    "link_box": {"boxes": {"lwr_arm_7_link": {"z": [-0.5, None]}}},
    "link_velocity": {"links": {"lwr_arm_7_link": 3.0}},
    "self_collision": {},
    "environment": {},
}
AROUND = Situation(
    obstacles=(
        Obstacle("table", "box", (1.0, 1.0, 0.1), Pose((-0.7, 0.0, 0.0))),
        Obstacle("pole", "cylinder", (0.1, 0.1, 2.0), Pose((-0.5, 0.6, 1.0))),
    )
)


def run(quick: bool) -> list[Result]:
    """Returns how long safe targets take, and those that `limit` has to replace."""
    count = QUICK_DECISIONS if quick else DECISIONS
    safe = _durations_ms("reject", count, 0.3)
    unsafe = _durations_ms("limit", QUICK_DECISIONS, 3.0)
    return [
        Result("guard", "safe target, all checks, median", float(np.median(safe)), "ms"),
        Result("guard", "safe target, all checks, p99", float(np.percentile(safe, 99)), "ms", target=Target(1.0)),
        Result("guard", "unsafe targets among others, `limit`, p99", float(np.percentile(unsafe, 99)), "ms"),
    ]


def _durations_ms(policy: str, count: int, amplitude: float) -> list[float]:
    limits = {"acceleration": 10.0, "jerk": 500.0}
    options = {"policy": policy, "period_s": PERIOD_S, "start_from": "target", "limits": limits, "checks": CHECKS}
    guard = Guard(GuardConfig.parse(options, "benchmark"), GuardedRobot(str(LWR)), "benchmark")
    guard.start()
    durations = []
    for k in range(count):
        t = k * PERIOD_S
        ramp = (1.0 - math.cos(math.pi * min(t / 2.0, 1.0))) / 2.0
        target = tuple((HOME + amplitude * ramp * ramp * np.sin(SPEEDS * t)).tolist())
        start_s = time.perf_counter()
        decision = guard.decide(target, AROUND)
        durations.append(1e3 * (time.perf_counter() - start_s))
        assert policy == "limit" or decision.command == target, decision.violation
    return durations
