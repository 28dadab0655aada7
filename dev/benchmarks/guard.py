"""Time of a decision of the guard on a seven-joint arm, with all checks of joints and shapes.

Alone, and through ROS at 500 Hz; there the reference is a rospy echo of the same messages, alternating.
"""

from __future__ import annotations

import json
import math
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from result import Result, Target
from session import Session

from robot_model.model import RobotModel
from safe_robot.check import CheckContext
from safe_robot.config import GuardConfig
from safe_robot.guard import Guard

LWR = Path(__file__).resolve().parents[2] / "src/rpbi_examples/robots/kuka_lwr.urdf"
PERIOD_S = 0.002
HZ, ROUNDS = 500, 4
ROS_PERIOD_S = 0.75 / HZ
"""Of the guard: as docs/safety.md says it is less than that of targets, so that late ones are caught up with."""
SAFE_RAD, UNSAFE_RAD = 0.22, 3.0
"""Amplitudes of joints: one keeps the arm outside the margin of all bodies, one does not."""
LIMITS = {"acceleration": 10.0, "jerk": 500.0}
DECISIONS, QUICK_DECISIONS = 20_000, 2_000
HOME = np.array((0.0, 0.5, 0.0, -1.2, 0.0, 0.8, 0.0))
SPEEDS = np.array((0.7, 0.9, 1.1, 1.3, 1.7, 1.9, 2.3))
"""Frequencies at which the joints swing [rad/s]."""
CHECKS = {
    "link_box": {"boxes": {"lwr_arm_7_link": {"z": [-0.5, 5.0]}}},
    "link_velocity": {"links": {"lwr_arm_7_link": 3.0}},
    "self_collision": {},
}
TABLE = {"shapeType": "GEOM_BOX", "halfExtents": [0.5, 0.5, 0.05]}
POLE = {"shapeType": "GEOM_CYLINDER", "radius": 0.05, "height": 2.0}
BODIES = {"table": (TABLE, (-0.7, 0.0, 0.0)), "pole": (POLE, (-0.5, 0.6, 1.0))}
"""Shapes [m] and where they are [m]."""


def run(quick: bool) -> list[Result]:
    """Returns the times of safe targets, and of targets that `limit` has to replace."""
    count = QUICK_DECISIONS if quick else DECISIONS
    with tempfile.TemporaryDirectory() as folder:
        checks = {**CHECKS, "environment": {"world": _world(Path(folder))}}
        safe = _durations_ms("reject", count, SAFE_RAD, checks)
        unsafe = _durations_ms("limit", QUICK_DECISIONS, UNSAFE_RAD, checks)
    return [
        *_through_ros(1.0 if quick else 5.0),
        Result("guard", "safe target, all checks, median", float(np.median(safe)), "ms"),
        Result("guard", "safe target, all checks, p99", float(np.percentile(safe, 99)), "ms", target=Target(1.0)),
        Result("guard", "unsafe targets among others, `limit`, median", float(np.median(unsafe)), "ms"),
        Result("guard", "unsafe targets among others, `limit`, p99", float(np.percentile(unsafe, 99)), "ms"),
    ]


def _world(folder: Path) -> str:
    """Writes a world with the bodies around the robot, and returns its file."""
    for name, (shape, position) in BODIES.items():
        seen = {"shapeType": "GEOM_SPHERE"}  # every body has to have a shape that is seen
        body = {"name": name, "createVisualShape": seen, "createCollisionShape": shape, "basePosition": position}
        (folder / f"{name}.yaml").write_text(json.dumps(body))
    path = folder / "world.yaml"
    files = [f"{name}.yaml" for name in BODIES]
    path.write_text(json.dumps({"connect": {"connection_mode": "DIRECT"}, "collision_objects": files}))
    return str(path)


def _through_ros(seconds: float) -> list[Result]:
    """Returns the time from the publication of a target to its command, and the number of commanded targets."""
    echoed, commanded, shares = [], [], []
    options = {"start_from": "target", "period_s": ROS_PERIOD_S, "limits": LIMITS}
    with Session(use_sim_time=False) as ros:
        # lateness is measured
        more = {"environment": {"world": _world(ros.folder)}, "staleness": {"timeout_s": 1.0}}
        options |= {"silence_s": 1.0, "checks": {**CHECKS, **more}}
        ros.program("echo", "/sent", "/echoed")
        ros.set_parameters("/robot_safety_node", {**options, "robot_description": str(LWR)})
        node = ["rosrun", "safe_robot", "safe_robot_node.py", "__name:=robot_safety_node"]
        guard = ros.node(node, "/robot_safety/start_subscriber")
        for _ in range(ROUNDS):
            for topic, answer in (("/sent", "/echoed"), ("/joint_states/target", "/joint_states/command")):
                client = ros.program("circle", topic, answer, HZ, round(HZ * seconds), "--joint-states")
                result = ros.result_of(client)
                (echoed if topic == "/sent" else commanded).extend(1e3 * np.array(result["latencies_s"]))
            shares.append(100.0 * result["answered"])
        if min(shares) < 100.0:
            print(f"not all targets were commanded; the guard says:\n{ros.output(guard)}", file=sys.stderr)

    def percentiles(percentile: float) -> tuple[float, float]:
        found, floor = (np.percentile(each, percentile, method="higher") for each in (commanded, echoed))
        return float(found), float(floor)

    (p50, floor_p50), (p99, floor_p99) = percentiles(50), percentiles(99)
    return [
        Result("guard", f"target to command at {HZ} Hz, p50", p50, "ms", floor_p50),
        Result("guard", f"target to command at {HZ} Hz, p99", p99, "ms", floor_p99, Target(3.0, of_floor=True)),
        Result("guard", f"commanded at {HZ} Hz", float(np.mean(shares)), "%", target=Target(100.0, at_least=True)),
    ]


def _durations_ms(policy: str, count: int, amplitude: float, checks: dict[str, Any]) -> list[float]:
    options = {"policy": policy, "period_s": PERIOD_S, "start_from": "target", "limits": LIMITS, "checks": checks}
    guard = Guard(GuardConfig.parse(options, "benchmark"), RobotModel(str(LWR)), "benchmark")
    guard.start()
    durations = []
    for k in range(count):
        t = k * PERIOD_S
        ramp = (1.0 - math.cos(math.pi * min(t / 2.0, 1.0))) / 2.0
        target = tuple((HOME + amplitude * ramp * ramp * np.sin(SPEEDS * t)).tolist())
        start_s = time.perf_counter()
        decision = guard.decide(target, CheckContext())
        durations.append(1e3 * (time.perf_counter() - start_s))
        assert policy == "limit" or decision.command == target, decision.violation
    return durations
