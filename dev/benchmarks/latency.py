"""From a target published to the first joint state in which the joint moves; the floor is a rospy echo and a tick.

Echo and simulator are measured alternately, alone and with busy loops.
"""

from __future__ import annotations

import sys

import numpy as np
import numpy.typing as npt
from bench_worlds import CAMERA, arm_world
from result import Result, Target
from session import COLOUR, DEPTH, JOINT_STATES, Session

HZ = 1000
TICK_MS = 1e3 / HZ
JOINT = "lwr_arm_5_joint"
TARGET = f"{JOINT_STATES}/target"
BUSY, BUSY_LOOP = 4, "while True: pass"
TURNS = 2


def run(quick: bool) -> list[Result]:
    """Measures p50 and p99: alone, with busy loops, and with the camera."""
    trials = 50 if quick else 300
    turns = [(_echo_ms(trials, busy), _arm_ms(trials, busy)) for _ in range(TURNS) for busy in (0, BUSY)]
    floor, alone = (np.concatenate(each) for each in zip(*turns[::2]))
    busy_floor, busy = (np.concatenate(each) for each in zip(*turns[1::2]))
    with Session() as ros:
        ros.place_camera()
        ros.simulator(arm_world(ros.folder, HZ, rgbd_sensor=CAMERA))
        ros.watch(COLOUR, DEPTH)
        beside_camera = _latencies_ms(ros, trials)
    p50, p99 = (float(np.percentile(floor, p)) + TICK_MS for p in (50, 99))
    busy_p50, busy_p99 = (float(np.percentile(busy_floor, p)) + TICK_MS for p in (50, 99))
    beside = f"beside {BUSY} busy loops"
    return [
        Result("latency", "p50", float(np.percentile(alone, 50)), "ms", p50, Target(1.5, of_floor=True)),
        Result("latency", "p99", float(np.percentile(alone, 99)), "ms", p99, Target(3.0, of_floor=True)),
        Result("latency", f"p50 {beside}", float(np.percentile(busy, 50)), "ms", busy_p50),
        Result("latency", f"p99 {beside}", float(np.percentile(busy, 99)), "ms", busy_p99, Target(3.0, of_floor=True)),
        Result("latency", "p50 beside the camera", float(np.percentile(beside_camera, 50)), "ms", p50),
        Result("latency", "p99 beside the camera", float(np.percentile(beside_camera, 99)), "ms", p99, Target(5.0)),
    ]


def _echo_ms(trials: int, busy: int) -> npt.NDArray[np.float64]:
    """Returns the latencies of a node that answers [ms], with a number of busy loops."""
    with Session(use_sim_time=False) as ros:
        _start_busy(ros, busy)
        ros.program("echo", TARGET, JOINT_STATES)
        return _latencies_ms(ros, trials)


def _arm_ms(trials: int, busy: int) -> npt.NDArray[np.float64]:
    """Returns the latencies of the arm [ms], with a number of busy loops."""
    with Session() as ros:
        _start_busy(ros, busy)
        ros.simulator(arm_world(ros.folder, HZ))
        return _latencies_ms(ros, trials)


def _start_busy(ros: Session, busy: int) -> None:
    for _ in range(busy):
        ros.start([sys.executable, "-c", BUSY_LOOP])


def _latencies_ms(ros: Session, trials: int) -> npt.NDArray[np.float64]:
    """Returns the latencies of trials [ms], shape (trials,)."""
    client = ros.program("step_response", JOINT, JOINT_STATES, TARGET, trials)
    return np.array(ros.result_of(client)) * 1e3
