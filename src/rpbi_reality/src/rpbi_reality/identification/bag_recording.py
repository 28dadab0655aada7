"""Reads measured motion from a bag: joint states, joint targets, and poses of objects."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from custom_ros_tools.errors import ConfigError, Problem
from rpbi_data.bags.bag_reader import bag_to_dataframes

from ..pose_errors import unit_quaternions
from .fit_config import FitConfig
from .recordings import JointTrack, MeasuredRun, PoseTrack

_POSES = {
    "pose/pose": ("position", "orientation"),
    "pose": ("position", "orientation"),
    "transform": ("translation", "rotation"),
}
"""Fields of messages with poses: `Odometry`, `PoseStamped` and `TransformStamped`."""


def signal_of(topic: str) -> str:
    """Returns the name of a topic's signal: the object's name, or the topic without the leading slash."""
    parts = topic.strip("/").split("/")
    if parts[-1] in ("joint_states", "base_state") and len(parts) > 1:
        return parts[-2]
    if parts[-1] == "target" and len(parts) > 2:
        return f"{parts[-3] if parts[-2] == 'joint_states' else parts[-2]}/target"
    return "/".join(parts)


def read_bag(path: Path, config: FitConfig) -> MeasuredRun:
    """Reads the signals of a bag; the run starts when all measured signals have started.

    Raises:
        BagError: If the file is no complete bag.
        ConfigError: If the bag lacks a measured signal.
    """
    tables = {signal_of(topic): table for topic, table in bag_to_dataframes(path).items()}
    tables = {name: table[~table.index.duplicated()] for name, table in tables.items() if len(table)}
    if missing := [signal for signal in config.measured if signal not in tables]:
        message = f"expected a topic of this signal; the bag has {', '.join(sorted(tables)) or 'no tables'}"
        raise ConfigError([Problem(str(path), missing[0], message)])
    start_s = max(float(tables[signal].index[0]) for signal in config.measured)
    poses: dict[str, PoseTrack] = {}
    joints: dict[str, JointTrack] = {}
    inputs: dict[str, JointTrack] = {}
    for name, table in tables.items():
        if name in config.measured:
            after = table[table.index >= start_s]
            time = after.index.to_numpy(float) - start_s
            names, positions = _joints(after)
            if names:
                joints[name] = JointTrack(time, names, positions)
            elif (pose := _pose(after)) is not None:
                poses[name] = PoseTrack(time, pose[:, :3], unit_quaternions(pose[:, 3:]))
        elif name.endswith("/target"):
            names, positions = _joints(table.ffill().bfill())
            if names:
                time = np.maximum(table.index.to_numpy(float) - start_s, 0.0)
                last = np.append(np.diff(time) > 0.0, True)  # of the targets before the start, the newest counts
                inputs[name] = JointTrack(time[last], names, positions[last])
    return MeasuredRun(path.stem, poses, joints, inputs)


def _joints(table: pd.DataFrame) -> tuple[tuple[str, ...], np.ndarray]:
    columns = [name for name in table.columns if name.startswith("position/")]
    names = tuple(name.removeprefix("position/") for name in columns)
    is_place = set(names) <= {"x", "y", "z"}  # of a pose
    return ((), np.zeros((0, 0))) if is_place else (names, table[columns].to_numpy(float))


def _pose(table: pd.DataFrame) -> np.ndarray | None:
    for prefix, (place, turn) in _POSES.items():
        columns = [f"{prefix}/{place}/{axis}" for axis in "xyz"] + [f"{prefix}/{turn}/{axis}" for axis in "xyzw"]
        if set(columns) <= set(table.columns):
            return table[columns].to_numpy(float)
    return None
