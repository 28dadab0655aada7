"""Time to convert a bag to tables, compared with a bare loop that only reads its messages."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import genpy
import rosbag
from result import Result, Target
from sensor_msgs.msg import Image, JointState

from rpbi_data import bag_to_dataframes

MESSAGES = 100_000
QUICK_MESSAGES = 10_000
JOINTS = [f"lwr_arm_{index}_joint" for index in range(7)]
TARGET_S = 2.5
RATIO = 1.4
"""Most time over that of reading the raw bag."""
IMAGES_MB, QUICK_IMAGES_MB = 1000, 200
SPEED_MB_S, MEMORY = 150.0, 3.0
IMAGE_TOPIC = "/rpbi/camera/colour/image"
MEASURE = """
import json, resource, sys, time
from rpbi_data import bag_to_dataframes
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
begin_s = time.perf_counter()
tables = bag_to_dataframes(sys.argv[1])
seconds = time.perf_counter() - begin_s
used = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
size = sum(table.memory_usage(deep=True).sum() for table in tables.values())
print(json.dumps([seconds, used / float(size)]))
"""
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
            results.append(Result("tables", figure, value, "s", floor, Target(RATIO, of_floor=True)))
            results.append(Result("tables", f"{figure}: time", value, "s", None, target))
        path = Path(folder) / "images.bag"
        megabytes = QUICK_IMAGES_MB if quick else IMAGES_MB
        _write_with_images(path, megabytes, messages)
        seconds, share = json.loads(
            subprocess.run(
                [sys.executable, "-c", MEASURE, str(path)], capture_output=True, text=True, check=True
            ).stdout.splitlines()[-1]
        )
        speed = path.stat().st_size / 1e6 / seconds
        figure = f"bag of {megabytes} MB with images, which are skipped"
        results.append(Result("tables", figure, speed, "MB/s", None, Target(SPEED_MB_S, at_least=True)))
        results.append(Result("tables", "memory over that of the tables", share, "", None, Target(MEMORY)))
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


def _write_with_images(path: Path, megabytes: int, messages: int) -> None:
    """Writes joint states, and images of 640x480 pixels between them, without compression."""
    image = Image(height=480, width=640, encoding="rgb8", step=1920, data=bytes(480 * 1920))
    images = megabytes * 1_000_000 // len(image.data)
    state = JointState(name=JOINTS, position=[0.0] * len(JOINTS))
    with rosbag.Bag(str(path), "w") as bag:
        for index in range(messages):
            stamp = genpy.Time(1 + index // 1000, index % 1000 * 1_000_000)
            state.header.stamp = image.header.stamp = stamp
            bag.write(TOPIC, state, stamp)
            if index % (messages // images) == 0:
                bag.write(IMAGE_TOPIC, image, stamp)


def _read(path: Path) -> None:
    """Reads the messages and leaves them serialised: the least that rosbag can do."""
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
