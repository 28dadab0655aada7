"""Measured runs of an arm that reaches and pushes a cube, as `./rpbi reality --convert` writes them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..npz_file import fault, read_npz, require, rows_of
from ..pose_errors import angle_deg, unit_quaternions

STEP_S = 0.05
"""Interval [s] at which simulated and measured poses are compared."""
END_S = {1: 5.5, 2: 19.8, 3: 17.6}
"""Time [s] at which the comparison ends, indexed by experiment; the recordings end soon after."""
_POSES: dict[str, tuple[int | None, ...]] = {
    "hand_position": (None, 3),
    "hand_quaternion": (None, 4),
    "cube_position": (None, 3),
    "cube_quaternion": (None, 4),
}
_ROWS: dict[str, tuple[int | None, ...]] = {"time": (None,), "offset": (None,), "experiment": (None,)}


class PushPoses(NamedTuple):
    """Poses of hand and cube at the times of comparison, in the frame of the arm's base.

    Attributes:
        hand_position: Positions of the link `m1n6s300_link_6` [m], shape (n, 3).
        hand_quaternion: Orientations of this link x, y, z, w, shape (n, 4).
        cube_position: Positions of the cube's centre [m], shape (n, 3).
        cube_quaternion: Orientations of the cube x, y, z, w, shape (n, 4).
    """

    hand_position: np.ndarray
    hand_quaternion: np.ndarray
    cube_position: np.ndarray
    cube_quaternion: np.ndarray


class PushErrors(NamedTuple):
    """Errors of a simulation of one experiment, one number for each measured run, shape (runs,).

    Attributes:
        hand_mm: Mean distance of the hand over time [mm].
        hand_deg: Mean angle of the hand over time [deg].
        cube_mm: Mean distance of the cube over time [mm].
        cube_deg: Mean angle of the cube over time [deg].
        cube_final_mm: Distance of the cube at the end [mm].
        cube_final_deg: Angle of the cube at the end [deg].
    """

    hand_mm: np.ndarray
    hand_deg: np.ndarray
    cube_mm: np.ndarray
    cube_deg: np.ndarray
    cube_final_mm: np.ndarray
    cube_final_deg: np.ndarray


class PushRun(NamedTuple):
    """A run, measured or of one of the studies' simulators.

    Attributes:
        experiment: Number of the experiment, 1 to 3.
        name: Number of the run, or name of the simulator.
        poses: Poses at the times of comparison.
    """

    experiment: int
    name: str
    poses: PushPoses


def times(experiment: int) -> np.ndarray:
    """Returns the times [s] of comparison of an experiment, shape (n,)."""
    return np.arange(0.0, END_S[experiment] + STEP_S / 2.0, STEP_S)


def read_runs(path: Path) -> list[PushRun]:
    """Reads the runs of an NPZ file, measured or of simulators.

    Raises:
        ConfigError: If the file is not of the expected form, or lengths look like millimetres.
    """
    arrays = read_npz(path)
    require(path, {**arrays, "time": arrays.get("time", np.zeros(()))}, _ROWS)
    diverged = np.zeros(0, bool)
    if "simulator" in arrays:  # a study's own simulation may have diverged
        diverged = ~np.all([np.isfinite(arrays[key]).all(1) for key in _POSES if key in arrays], axis=0)
        arrays = {key: np.nan_to_num(each) if key in _POSES else each for key, each in arrays.items()}
    require(path, arrays, _POSES)
    for key in _POSES:
        if len(arrays[key]) != len(arrays["time"]):
            raise fault(path, key, f"expected {len(arrays['time'])} rows, as `time` has, got {len(arrays[key])}")
    if "simulator" not in arrays and max(abs(arrays[key]).max() for key in ("hand_position", "cube_position")) > 20.0:
        raise fault(path, "hand_position", "expected metres, got more than 20; are lengths in millimetres?")
    count = len(arrays["experiment"])
    names = arrays.get("simulator", arrays.get("run", np.arange(count)))
    if len(names) != count:
        raise fault(path, "run", f"expected {count} names, as `experiment` has, got {len(names)}")
    runs = []
    for index, rows in enumerate(rows_of(path, arrays["offset"], len(arrays["time"]), count)):
        experiment, time = int(arrays["experiment"][index]), arrays["time"][rows].astype(float)
        if experiment not in END_S:
            raise fault(path, "experiment", f"expected 1, 2 or 3, got {experiment}")
        if (np.diff(time) <= 0.0).any():
            raise fault(path, "time", f"expected increasing times in run {names[index]} of experiment {experiment}")
        if time[0] > 0.5 or time[-1] < END_S[experiment] - 0.5:
            covered = f"run {names[index]} of experiment {experiment} covers {time[0]:.1f} to {time[-1]:.1f} s"
            raise fault(path, "time", f"expected 0 to {END_S[experiment]:g} s; {covered}")
        if len(diverged) and diverged[rows].any():
            continue
        measured = {key: arrays[key][rows].astype(float) for key in _POSES}
        runs.append(PushRun(experiment, str(names[index]), interpolated(time, measured, times(experiment))))
    return runs


def interpolated(time: np.ndarray, poses: Mapping[str, np.ndarray], when: np.ndarray) -> PushPoses:
    """Interpolates poses linearly, and scales quaternions to norm 1.

    Args:
        time: Increasing times [s], shape (m,).
        poses: Arrays of the fields of `PushPoses` at these times, m rows each.
        when: New times [s], shape (n,).
    """
    rows = []
    for name in _POSES:
        values = unit_quaternions(poses[name]) if name.endswith("quaternion") else poses[name]
        each = np.stack([np.interp(when, time, column) for column in values.T], 1)
        rows.append(unit_quaternions(each) if name.endswith("quaternion") else each)
    return PushPoses(*rows)


def mean_poses(many: Iterable[PushPoses]) -> PushPoses:
    """Returns the mean of poses of several runs at the same times."""
    columns = []
    for name, stack in zip(PushPoses._fields, map(np.stack, zip(*many))):
        if name.endswith("quaternion"):
            stack = stack * np.where((stack * stack[:1]).sum(2) < 0.0, -1.0, 1.0)[:, :, None]
            mean = stack.mean(0)
            columns.append(mean / np.linalg.norm(mean, axis=1, keepdims=True))
        else:
            columns.append(stack.mean(0))
    return PushPoses(*columns)


def errors_against(poses: PushPoses, runs: Iterable[PushPoses]) -> PushErrors:
    """Compares poses with those of each run."""
    return PushErrors(*np.array([_difference(poses, run) for run in runs]).T)


def spread(runs: list[PushPoses]) -> PushErrors:
    """Compares each run with the mean of all others: reality's own spread.

    Args:
        runs: At least two runs of one experiment.
    """
    others = [mean_poses(runs[:index] + runs[index + 1 :]) for index in range(len(runs))]
    return PushErrors(*np.array([_difference(mean, run) for mean, run in zip(others, runs)]).T)


def _difference(a: PushPoses, b: PushPoses) -> tuple[float, ...]:
    hand = np.linalg.norm(a.hand_position - b.hand_position, axis=1) * 1e3
    cube = np.linalg.norm(a.cube_position - b.cube_position, axis=1) * 1e3
    turn = angle_deg(a.cube_quaternion, b.cube_quaternion)
    hand_turn = angle_deg(a.hand_quaternion, b.hand_quaternion)
    return hand.mean(), hand_turn.mean(), cube.mean(), turn.mean(), cube[-1], turn[-1]
