"""How long a bag takes to become tables, beside a bare loop that only reads its messages."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import genpy
import rosbag
from result import Result, Target
from sensor_msgs.msg import JointState

from rpbi_utils import bag_to_dataframes

MESSAGES = 100_000
QUICK_MESSAGES = 10_000
JOINTS = [f"lwr_arm_{index}_joint" for index in range(7)]
TARGET_S = 2.5
TOPIC = "/rpbi/kuka_lwr/joint_states"


def run(quick: bool) -> list[Result]:
    """Measures joint states of 7 joints, bag to DataFrame, without compression and with lz4; the best of three.

    Args:
        quick: Whether a tenth of the messages will do; the target is for all of them and scales with it.
    """
    messages = QUICK_MESSAGES if quick else MESSAGES
    target = Target(TARGET_S * messages / MESSAGES)
    results = []
    with tempfile.TemporaryDirectory(prefix="rpbi-bench-") as folder:
        for compression in ("none", "lz4"):
            path = Path(folder) / f"{compression}.bag"
            _write(path, messages, compression)
            value = _best(lambda path=path: bag_to_dataframes(path))
            floor = _best(lambda path=path: _read(path))
            figure = f"{messages} joint states, compression {compression}"
            results.append(Result("tables", figure, value, "s", floor, target))
    return results


def _write(path: Path, messages: int, compression: str) -> None:
    state = JointState(name=JOINTS, effort=[0.0] * len(JOINTS))
    with rosbag.Bag(str(path), "w", compression=compression) as bag:
        for index in range(messages):
            state.header.seq = index
            state.header.stamp = genpy.Time(1 + index // 1000, index % 1000 * 1_000_000)
            state.position = [index * 1e-3 + joint for joint in range(len(JOINTS))]
            state.velocity = [index * 1e-4 - joint for joint in range(len(JOINTS))]
            bag.write(TOPIC, state, state.header.stamp)


def _read(path: Path) -> None:
    """Reads the messages and leaves them serialised: less than this cannot be done with rosbag."""
    with rosbag.Bag(str(path)) as bag:
        for _ in bag.read_messages(raw=True):
            pass


def _best(job: Callable[[], object], repeats: int = 3) -> float:
    """Returns the shortest wall time of a job [s]."""
    durations = []
    for _ in range(repeats):
        start_s = time.perf_counter()
        job()
        durations.append(time.perf_counter() - start_s)
    return min(durations)
