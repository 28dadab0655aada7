"""From a target published to the first joint state in which the joint moves; the floor is a rospy echo and a tick."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from bench_worlds import CAMERA, arm_world
from result import Result, Target
from session import COLOUR, DEPTH, JOINT_STATES, Session

HZ = 1000
TICK_MS = 1e3 / HZ
JOINT = "lwr_arm_5_joint"
TARGET = f"{JOINT_STATES}/target"


def run(quick: bool) -> list[Result]:
    """Measures p50 and p99, with and without the camera."""
    trials = 50 if quick else 300
    with Session(use_sim_time=False) as ros:
        ros.program("echo", TARGET, JOINT_STATES)
        floor = _latencies_ms(ros, trials)
    with Session() as ros:
        ros.simulator(arm_world(ros.folder, HZ))
        alone = _latencies_ms(ros, trials)
    with Session() as ros:
        ros.place_camera()
        ros.simulator(arm_world(ros.folder, HZ, rgbd_sensor=CAMERA))
        ros.watch(COLOUR, DEPTH)
        beside_camera = _latencies_ms(ros, trials)
    p50, p99 = (float(np.percentile(floor, p)) + TICK_MS for p in (50, 99))
    return [
        Result("latency", "p50", float(np.percentile(alone, 50)), "ms", p50, Target(1.5, of_floor=True)),
        Result("latency", "p99", float(np.percentile(alone, 99)), "ms", p99, Target(3.0, of_floor=True)),
        Result("latency", "p50 beside the camera", float(np.percentile(beside_camera, 50)), "ms", p50),
        Result("latency", "p99 beside the camera", float(np.percentile(beside_camera, 99)), "ms", p99, Target(5.0)),
    ]


def _latencies_ms(ros: Session, trials: int) -> npt.NDArray[np.float64]:
    """Returns the latencies of trials [ms], shape (trials,)."""
    client = ros.program("step_response", JOINT, JOINT_STATES, TARGET, trials)
    return np.array(ros.result_of(client)) * 1e3
