"""Demonstrations: points over time, made from arrays or from tables of a bag, and checked for errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from custom_ros_tools.errors import UnknownNameError
from custom_ros_tools.transforms import Array
from robot_model.geometry import rotation_between

from .errors import DemonstrationError
from .space import MAX_NORM, MIN_NORM, POSE, Space

if TYPE_CHECKING:
    import pandas as pd

MIN_SAMPLES = 10
"""Smallest number of samples; demonstrations with fewer samples are rejected."""
MAX_GAP_SHARE = 0.1
"""Largest time between two samples, as a fraction of the duration. A longer gap is rejected as a jump in time."""
MAX_TURN_RAD = 1.5
"""Largest rotation between two successive samples [rad]. A larger rotation is rejected as a jump."""
SPIKE_SHARE = 0.05
"""Smallest deviation that counts as a spike, as a fraction of the extent of the positions."""
SPIKE_TO_STEPS, SPIKE_TO_NOISE = 5.0, 10.0
"""Smallest deviation that counts as a spike, as a multiple of the steps around it and of the median deviation.

The deviation of a sample is its distance from the line between the samples before and after it.
"""
TRANSLATION = ("translation/x", "translation/y", "translation/z")
ROTATION = ("rotation/x", "rotation/y", "rotation/z", "rotation/w")
"""Columns of a table of /tf, see docs/data.md."""
JOINT_PREFIX = "position/"


@dataclass(frozen=True)
class Demonstration:
    """A demonstrated motion. Make demonstrations with the class methods, such as `of`, which check the numbers.

    Attributes:
        space: Names of the n positions, and whether points have an orientation.
        times: m strictly increasing times; the first is 0 [s].
        points: m points, shape (m, n), or (m, n + 4) with orientations.
    """

    space: Space
    times: Array
    points: Array

    @property
    def duration_s(self) -> float:
        """Time from the first to the last sample [s]."""
        return float(self.times[-1])

    @classmethod
    def of(
        cls,
        times: ArrayLike,
        positions: ArrayLike,
        quats_xyzw: ArrayLike | None = None,
        names: Sequence[str] | None = None,
    ) -> Demonstration:
        """Returns a checked demonstration.

        Args:
            times: m times [s].
            positions: m x n positions [m or rad].
            quats_xyzw: m quaternions x, y, z, w with any sign. By default, the motion does not include orientations.
            names: Names of the n positions. By default x, y, z for n = 3, otherwise q0, q1, ...

        Raises:
            DemonstrationError: If array lengths differ, a number is not finite, or there are fewer than 10 samples.
                Also if times do not increase or have a long gap, or if positions or orientations jump.
        """
        stamps = checked_array(times, "times", 1)
        where = checked_array(positions, "positions", 2)
        _check_rows("positions", where, stamps)
        check_increasing(stamps, MIN_SAMPLES)
        _check_no_jump(stamps)
        names = _default_names(where.shape[1]) if names is None else tuple(names)
        if len(names) != where.shape[1] or len(set(names)) != len(names):
            raise DemonstrationError("positions", f"one column for each of {', '.join(names)}", f"shape {where.shape}")
        _check_no_spike(stamps, where)
        if quats_xyzw is None:
            return cls(Space(names), stamps - stamps[0], where)
        quats = checked_array(quats_xyzw, "orientations", 2)
        _check_rows("orientations", quats, stamps)
        return cls(Space(names, True), stamps - stamps[0], np.hstack([where, _unit_quats(quats)]))

    @classmethod
    def of_points(cls, space: Space, times: ArrayLike, points: ArrayLike) -> Demonstration:
        """Returns a checked demonstration, made from m points of a space and m times [s]; raises errors like `of`."""
        values, n = checked_array(points, "positions", 2), len(space.names)
        return cls.of(times, values[:, :n], values[:, n:] if space.has_orientation else None, space.names)

    @classmethod
    def of_frame(cls, table: pd.DataFrame, parent: str, child: str, orientation: bool = True) -> Demonstration:
        """Returns the motion of the TF frame `child` in the frame `parent`, read from a table.

        Args:
            table: Table of /tf from `bag_to_dataframes`; its index is time [s].
            parent: Name of the reference frame.
            child: Name of the moving frame.
            orientation: Whether the demonstration includes orientations.

        Raises:
            UnknownNameError: If the table does not have the transform.
            DemonstrationError: As for `of`.
        """
        rows = table[(table["parent"].str.strip("/") == parent) & (table["child"].str.strip("/") == child)]
        if rows.empty:
            known = sorted({f"{p} -> {c}" for p, c in zip(table["parent"], table["child"])})
            raise UnknownNameError("transform", f"{parent} -> {child}", known)
        quats = rows[list(ROTATION)].to_numpy(float) if orientation else None
        return cls.of(rows.index.to_numpy(float), rows[list(TRANSLATION)].to_numpy(float), quats)

    @classmethod
    def of_joints(cls, table: pd.DataFrame, joints: Sequence[str] | None = None) -> Demonstration:
        """Returns the motion of joints, read from a table.

        Args:
            table: Table of joint states from `bag_to_dataframes`; its index is time [s].
            joints: Names of the joints, in the order of the demonstration's positions; by default all joints.

        Raises:
            UnknownNameError: If the table lacks a joint.
            DemonstrationError: As for `of`.
        """
        known = [name.removeprefix(JOINT_PREFIX) for name in table.columns if name.startswith(JOINT_PREFIX)]
        joints = known if joints is None else list(joints)
        for joint in joints:
            if joint not in known:
                raise UnknownNameError("joint", joint, known)
        columns = [JOINT_PREFIX + joint for joint in joints]
        return cls.of(table.index.to_numpy(float), table[columns].to_numpy(float), names=joints)


def common_space(demonstrations: Sequence[Demonstration]) -> Space:
    """Checks that all demonstrations have the same space, and returns the space.

    Raises:
        DemonstrationError: If the list is empty, or the spaces differ.
    """
    if not demonstrations:
        raise DemonstrationError("demonstrations", "at least one", "none")
    first = demonstrations[0].space
    for index, each in enumerate(demonstrations):
        if each.space != first:
            expected = f"{', '.join(first.point_names)} as in the first one"
            raise DemonstrationError("demonstrations", expected, f"{', '.join(each.space.point_names)} in [{index}]")
    return first


def _default_names(count: int) -> tuple[str, ...]:
    return POSE if count == len(POSE) else tuple(f"q{i}" for i in range(count))


def checked_array(values: ArrayLike, subject: str, dimensions: int) -> Array:
    """Converts numbers of a demonstration to an array, and checks that they are finite.

    Args:
        values: The numbers.
        subject: Name of the numbers in error messages.
        dimensions: Required number of array dimensions.

    Raises:
        DemonstrationError: If the number of dimensions differs, or a number is not finite.
    """
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise DemonstrationError(subject, "numbers, as many in each row", str(error)) from None
    if array.ndim != dimensions or (dimensions > 1 and array.shape[1] == 0):
        raise DemonstrationError(subject, f"an array of {dimensions} dimensions", f"shape {array.shape}")
    if not np.isfinite(array).all():
        index = int(np.argwhere(~np.isfinite(array))[0][0])
        raise DemonstrationError(subject, "finite numbers", f"{array[index]} in sample [{index}]")
    return array


def _check_rows(subject: str, array: Array, times: Array) -> None:
    if len(array) != len(times):
        raise DemonstrationError(subject, f"{len(times)} samples, as many as times", f"{len(array)}")


def check_increasing(times: Array, min_samples: int) -> None:
    """Checks that there are at least `min_samples` times, and that the times increase strictly [s].

    Raises:
        DemonstrationError: If there are fewer times, or a time is not greater than the previous time.
    """
    if len(times) < min_samples:
        raise DemonstrationError("times", f"at least {min_samples} samples", f"{len(times)}")
    steps = np.diff(times)
    for is_wrong, what in ((steps < 0.0, "runs back"), (steps == 0.0, "repeats")):
        if is_wrong.any():
            index = int(np.argmax(is_wrong))
            got = f"{times[index + 1]:.9g} s in sample [{index + 1}], which {what} from {times[index]:.9g} s"
            raise DemonstrationError("times", "strictly increasing times", got)


def _check_no_jump(times: Array) -> None:
    steps = np.diff(times)
    index, duration_s = int(np.argmax(steps)), float(times[-1] - times[0])
    typical_s = float(np.median(steps))
    if steps[index] > max(MAX_GAP_SHARE * duration_s, 3.0 * typical_s):
        got = f"{steps[index]:.3g} s after sample [{index}], {typical_s:.3g} s between others"
        raise DemonstrationError("times", "no jump", got)


def _check_no_spike(times: Array, positions: Array) -> None:
    """Raises a DemonstrationError if there is a spike: a sample that is far from the line between its neighbours, while
    the steps before and after these three samples are small."""
    share = ((times[1:-1] - times[:-2]) / (times[2:] - times[:-2]))[:, None]
    line = positions[:-2] + share * (positions[2:] - positions[:-2])
    off = np.linalg.norm(positions[1:-1] - line, axis=1)
    steps = np.pad(np.linalg.norm(np.diff(positions, axis=0), axis=1), 1)
    around = np.maximum(steps[:-3], steps[3:])  # the steps before and after the three samples
    extent = float(np.ptp(positions, axis=0).max())
    limits = np.maximum(SPIKE_TO_STEPS * around, max(SPIKE_SHARE * extent, SPIKE_TO_NOISE * float(np.median(off))))
    if (off > limits).any():
        index = int(np.argmax(off - limits))
        expected = f"at most {limits[index]:.3g} off the line between the samples before and after"
        raise DemonstrationError("positions", expected, f"a spike or jump of {off[index]:.3g} at sample [{index + 1}]")


def _unit_quats(quats: Array) -> Array:
    if quats.shape[1] != 4:
        raise DemonstrationError("orientations", "quaternions x, y, z, w", f"{quats.shape[1]} numbers each")
    lengths = np.linalg.norm(quats, axis=1)
    is_wrong = (lengths < MIN_NORM) | (lengths > MAX_NORM)
    if is_wrong.any():
        index = int(np.argmax(is_wrong))
        raise DemonstrationError("orientations", "length 1", f"length {lengths[index]:.3g} in sample [{index}]")
    unit = quats / lengths[:, None]
    rows = [tuple(row) for row in unit.tolist()]
    for index, (before, after) in enumerate(zip(rows, rows[1:])):
        angle = float(np.linalg.norm(rotation_between(before, after)))
        if angle > MAX_TURN_RAD:
            expected = f"at most {MAX_TURN_RAD:g} rad between samples"
            raise DemonstrationError("orientations", expected, f"{angle:.3g} rad before sample [{index + 1}]")
    return unit
