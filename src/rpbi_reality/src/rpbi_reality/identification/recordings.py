"""Measured motion: tracks of poses and joints, inputs, and the state at the start of each run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from custom_ros_tools.errors import ConfigError, Problem

MAX_JUMP = 50.0
"""Largest ratio of the longest interval between two stamps to the median interval."""
MAX_POSITION_M = 100.0
"""Position from which lengths look like millimetres."""
MAX_JOINT_RAD = 4.0 * np.pi
"""Joint position from which angles look like degrees."""


class PoseTrack(NamedTuple):
    """Poses by time.

    Attributes:
        time: Increasing times [s], shape (n,).
        position: Positions [m], shape (n, 3).
        quaternion: Orientations x, y, z, w, shape (n, 4).
    """

    time: np.ndarray
    position: np.ndarray
    quaternion: np.ndarray


class JointTrack(NamedTuple):
    """Joint positions by time, of a measurement or of an input.

    Attributes:
        time: Increasing times [s], shape (n,).
        names: Names of the m joints.
        position: Positions [rad or m], shape (n, m).
    """

    time: np.ndarray
    names: tuple[str, ...]
    position: np.ndarray


class BaseState(NamedTuple):
    """State of an object at the start of a run.

    Attributes:
        position: Position [m] of the object's frame in the world, shape (3,).
        quaternion: Orientation x, y, z, w, shape (4,).
        linear_velocity: Velocity [m/s] of the frame's origin, axes of the world, shape (3,).
        angular_velocity: Angular velocity [rad/s], axes of the world, shape (3,).
    """

    position: np.ndarray
    quaternion: np.ndarray
    linear_velocity: np.ndarray
    angular_velocity: np.ndarray


class MeasuredRun(NamedTuple):
    """A measured run, which starts at time 0.

    Attributes:
        name: Name of the run.
        poses: Tracks of poses, indexed by signal.
        joints: Tracks of joints, indexed by signal.
        inputs: Joint targets, indexed by the input's slot (`NAME/target`).
        starts: States at time 0, indexed by signal.
    """

    name: str
    poses: Mapping[str, PoseTrack]
    joints: Mapping[str, JointTrack] = {}
    inputs: Mapping[str, JointTrack] = {}
    starts: Mapping[str, BaseState] = {}

    @property
    def end_s(self) -> float:
        """Time of the last measurement [s]."""
        tracks: list[PoseTrack | JointTrack] = [*self.poses.values(), *self.joints.values()]
        return max(float(track.time[-1]) for track in tracks)


def check(file: str, run: MeasuredRun) -> None:
    """Checks times, units and overlap of a run.

    Raises:
        ConfigError: If stamps decrease or jump, tracks do not overlap in time, or values look like millimetres or
            degrees.
    """
    tracks: dict[str, PoseTrack | JointTrack] = {**run.poses, **run.joints, **run.inputs}
    for name, track in tracks.items():
        key = f"{name} of run {run.name}"
        steps = np.diff(track.time)
        if len(track.time) < 2:
            raise ConfigError([Problem(file, key, f"expected at least two measurements, got {len(track.time)}")])
        if not all(np.isfinite(each).all() for each in track if isinstance(each, np.ndarray)):
            raise ConfigError([Problem(file, key, "contains numbers that are not finite")])
        if (steps <= 0.0).any():
            at = float(track.time[int(np.argmax(steps <= 0.0))])
            raise ConfigError(
                [Problem(file, key, f"expected increasing times, but time does not increase after {at:g} s")]
            )
        if name not in run.inputs and steps.max() > MAX_JUMP * np.median(steps):
            at = float(track.time[int(steps.argmax())])
            message = f"expected steady stamps, but they jump by {steps.max():.3g} s after {at:g} s"
            raise ConfigError([Problem(file, key, message)])
        _check_units(file, key, track)
    measured: list[PoseTrack | JointTrack] = [*run.poses.values(), *run.joints.values()]
    if not measured:
        raise ConfigError([Problem(file, f"run {run.name}", "has no measured signal")])
    begin, end = max(float(each.time[0]) for each in measured), min(float(each.time[-1]) for each in measured)
    for slot, each in run.inputs.items():
        begin, end = max(begin, float(each.time[0])), min(end, float(each.time[-1]) + 1.0)
        if begin >= end:
            raise ConfigError(
                [Problem(file, f"{slot} of run {run.name}", "does not overlap in time with the measurements")]
            )
    if begin >= end:
        raise ConfigError([Problem(file, f"run {run.name}", "signals do not overlap in time")])


def _check_units(file: str, key: str, track: PoseTrack | JointTrack) -> None:
    largest = float(abs(track.position).max())
    if isinstance(track, PoseTrack):
        if largest > MAX_POSITION_M:
            raise ConfigError([Problem(file, key, f"expected metres, got {largest:g}; these look like millimetres")])
        if (abs(np.linalg.norm(track.quaternion, axis=1) - 1.0) > 0.01).any():
            raise ConfigError([Problem(file, key, "expected quaternions x, y, z, w of norm 1")])
    elif largest > MAX_JOINT_RAD:
        raise ConfigError([Problem(file, key, f"expected radians, got {largest:g}; these look like degrees")])
