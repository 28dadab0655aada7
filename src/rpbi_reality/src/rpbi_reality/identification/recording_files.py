"""Reads measured motion from files: NPZ, CSV, and the files of the published experiments."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from custom_ros_tools.errors import ConfigError, Problem

from ..npz_file import fault, read_npz, rows_of
from ..pose_errors import rotated, unit_quaternions
from ..pushes.push_data import read_runs, times
from ..tosses.toss_data import TossData
from .fit_config import FitConfig
from .recordings import BaseState, JointTrack, MeasuredRun, PoseTrack, check

POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
MAX_CSV_BYTES = 500_000_000


def read_recordings(path: Path, config: FitConfig) -> list[MeasuredRun]:
    """Reads all runs of a file.

    The file is an NPZ file of tosses or pushes (see docs/reality.md), or an NPZ, CSV or bag file of motion (see
    docs/identification.md).

    Raises:
        ConfigError: If the file is not of one of these forms, or its content makes no sense; see `recordings.check`.
    """
    if not path.is_file():
        raise ConfigError([Problem(str(path), "", "expected an NPZ, CSV or bag file; there is no such file")])
    if path.suffix == ".npz":
        arrays = read_npz(path)
        if "start_angular_velocity" in arrays:
            runs = _tosses(path)
        elif "hand_position" in arrays:
            runs = _pushes(path, config)
        else:
            runs = _motion(path, arrays)
    elif path.suffix == ".csv":
        runs = [_table(path)]
    elif path.suffix == ".bag":
        from .bag_recording import read_bag

        runs = [read_bag(path, config)]
    else:
        raise ConfigError([Problem(str(path), "", "expected a file .npz, .csv or .bag")])
    for run in runs:
        check(str(path), run)
        for signal in config.measured:
            if signal not in run.poses and signal not in run.joints:
                known = ", ".join(sorted({*run.poses, *run.joints}))
                raise ConfigError([Problem(str(path), signal, f"run {run.name} lacks this signal; it has {known}")])
    return runs


def _tosses(path: Path) -> list[MeasuredRun]:
    data = TossData.read(path)
    runs = []
    for toss in data.tosses:
        time = np.arange(len(toss.position)) / data.frame_rate
        spin = rotated(toss.start.quaternion, toss.start.angular_velocity)
        start = BaseState(toss.start.position, toss.start.quaternion, toss.start.linear_velocity, spin)
        poses = {"cube": PoseTrack(time, toss.position, unit_quaternions(toss.quaternion))}
        runs.append(MeasuredRun(toss.name, poses, starts={"cube": start}))
    return runs


def _pushes(path: Path, config: FitConfig) -> list[MeasuredRun]:
    runs = []
    for run in read_runs(path):
        if config.runs.experiment in (None, run.experiment):
            time, poses = times(run.experiment), run.poses
            tracks = {
                "hand": PoseTrack(time, poses.hand_position, poses.hand_quaternion),
                "cube": PoseTrack(time, poses.cube_position, poses.cube_quaternion),
            }
            runs.append(MeasuredRun(run.name, tracks))
    if not runs:
        raise fault(path, "experiment", f"there is no run of experiment {config.runs.experiment}")
    return runs


def _motion(path: Path, arrays: dict[str, np.ndarray]) -> list[MeasuredRun]:
    """Reads `time`, and `SIGNAL/pose`, `SIGNAL/joints` and `SLOT/input` with the names `SIGNAL/names`, `SLOT/names`."""
    if "time" not in arrays or arrays["time"].ndim != 1:
        raise fault(path, "time", f"expected times of shape (n,); the file has {', '.join(sorted(arrays))}")
    time = arrays["time"]
    offset = arrays.get("offset", np.array([0, len(time)]))
    runs = []
    for number, rows in enumerate(rows_of(path, offset, len(time), len(offset) - 1)):
        poses: dict[str, PoseTrack] = {}
        joints: dict[str, JointTrack] = {}
        inputs: dict[str, JointTrack] = {}
        when = (time[rows] - time[rows][0]).astype(float)
        for key, array in arrays.items():
            name, _, kind = key.rpartition("/")
            if kind not in ("pose", "joints", "input"):
                continue
            if array.ndim != 2 or len(array) != len(time) or array.dtype.kind not in "fiu":
                raise fault(path, key, f"expected numbers of shape ({len(time)}, columns), got {array.shape}")
            values = array[rows].astype(float)
            if kind == "pose":
                if array.shape[1] != 7:
                    raise fault(path, key, f"expected columns {', '.join(POSE)}, got {array.shape[1]}")
                poses[name] = PoseTrack(when, values[:, :3], unit_quaternions(values[:, 3:]))
                continue
            names = tuple(map(str, arrays.get(f"{name}/names", ())))
            if len(names) != array.shape[1]:
                raise fault(path, f"{name}/names", f"expected {array.shape[1]} names of joints, got {len(names)}")
            (joints if kind == "joints" else inputs)[name] = JointTrack(when, names, values)
        runs.append(MeasuredRun(str(number), poses, joints, inputs))
    return runs


def _table(path: Path) -> MeasuredRun:
    """Reads a CSV file with columns `time`, `SIGNAL.x` ... `SIGNAL.qw`, `SIGNAL.joint.NAME` and `SLOT.input.NAME`."""
    if path.stat().st_size > MAX_CSV_BYTES:
        raise ConfigError([Problem(str(path), "", f"expected at most {MAX_CSV_BYTES:,} bytes")])
    try:
        table = pd.read_csv(path)
        numbers = {str(name): table[name].to_numpy(float) for name in table.columns}
    except (ValueError, UnicodeDecodeError) as error:
        raise ConfigError([Problem(str(path), "", f"expected a CSV file of numbers: {error}")]) from None
    if "time" not in numbers:
        raise ConfigError([Problem(str(path), "time", f"missing; the columns are {', '.join(numbers)}")])
    time = numbers["time"] - numbers["time"][0] if len(numbers["time"]) else numbers["time"]
    poses = {}
    for name in numbers:
        signal = name.removesuffix(".x")
        if signal != name:
            absent = [f"{signal}.{part}" for part in POSE if f"{signal}.{part}" not in numbers]
            if absent:
                raise ConfigError([Problem(str(path), absent[0], "missing")])
            columns = np.stack([numbers[f"{signal}.{part}"] for part in POSE], 1)
            poses[signal] = PoseTrack(time, columns[:, :3], unit_quaternions(columns[:, 3:]))
    tracks: dict[str, dict[str, JointTrack]] = {}
    for kind in ("joint", "input"):
        groups: dict[str, list[str]] = {}
        for name in numbers:
            signal, mark, joint = name.partition(f".{kind}.")
            if mark:
                groups.setdefault(signal, []).append(joint)
        tracks[kind] = {
            signal: JointTrack(time, tuple(names), np.stack([numbers[f"{signal}.{kind}.{each}"] for each in names], 1))
            for signal, names in groups.items()
        }
    return MeasuredRun(path.stem, poses, tracks["joint"], tracks["input"])
