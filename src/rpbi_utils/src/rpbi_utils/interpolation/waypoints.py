"""Reads waypoints from messages."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_model.geometry import Quaternion

from .config import MotionDimensions, RotationConfig, WaypointError

Array = NDArray[np.float64]


class Waypoints(NamedTuple):
    """K waypoints of a motion.

    Attributes:
        times_s: K times [s], strictly increasing.
        scalars: Values of the S rows that are interpolated as numbers [m or rad], shape (K, S).
        rates: First derivatives of the scalars [m/s or rad/s], shape (K, S); None to estimate the derivatives.
        accelerations: Second derivatives of the scalars [m/s^2 or rad/s^2], shape (K, S); None to estimate them.
        quats_xyzw: K orientations x, y, z, w; None if the orientation is constant or part of the scalars.
    """

    times_s: tuple[float, ...]
    scalars: Array
    rates: Array | None = None
    accelerations: Array | None = None
    quats_xyzw: tuple[Quaternion, ...] | None = None

    def slower(self, factor: float) -> Waypoints:
        """Returns the waypoints with the derivatives of a motion that is `factor` times slower, but the same times."""
        rates = None if self.rates is None else self.rates / factor
        accelerations = None if self.accelerations is None else self.accelerations / factor**2
        return self._replace(rates=rates, accelerations=accelerations)


def waypoint_matrix(layout: Sequence[tuple[str, int]], data: Sequence[float], offset: int = 0) -> Array:
    """Returns the content of a Float64MultiArray as a matrix, shape (rows, columns).

    Args:
        layout: Label and size of the dimensions `rows` and `columns`.
        data: Numbers of the message, row by row.
        offset: Number of elements to skip at the start of `data` (the message's `data_offset`).

    Raises:
        WaypointError: If a label or a size is wrong.
    """
    if len(layout) != 2:
        raise WaypointError(f"layout.dim: expected 2 dimensions, 'rows' and 'columns', got {len(layout)}")
    for index, ((label, _), expected) in enumerate(zip(layout, ("rows", "columns"))):
        if label != expected:
            raise WaypointError(f"layout.dim[{index}].label: expected '{expected}', got '{label[:60]}'")
    (_, rows), (_, columns) = layout
    if len(data) - offset != rows * columns:
        expected = f"{rows} rows of {columns} columns, {rows * columns} numbers"
        raise WaypointError(f"data: expected {expected}, got {len(data) - offset}")
    return np.asarray(data, dtype=float)[offset:].reshape(rows, columns)


def read_waypoints(matrix: Array, dimensions: MotionDimensions) -> Waypoints:
    """Converts a matrix to waypoints.

    Args:
        matrix: Each column is a waypoint. Row 0 has the times [s], and the next n rows have the values. Optionally, n
            rows with first derivatives follow, and then n rows with second derivatives.
        dimensions: Number n of values per waypoint, and the meaning of their rows.

    Raises:
        WaypointError: If the matrix has another shape, times do not increase, or a number is not finite.
    """
    n = dimensions.number
    rows, columns = matrix.shape
    if rows not in (1 + n, 1 + 2 * n, 1 + 3 * n) or not columns:
        forms = f"{1 + n}, {1 + 2 * n} or {1 + 3 * n} rows for motion_dimensions.number {n}"
        raise WaypointError(f"layout.dim: expected {forms}, and a column at least, got {rows} and {columns}")
    bad = np.argwhere(~np.isfinite(matrix))
    if len(bad):
        row, column = bad[0].tolist()
        raise WaypointError(f"data: expected finite numbers, got {matrix[row, column]} in row {row}, column {column}")
    times_s = matrix[0]
    for column in np.flatnonzero(np.diff(times_s) <= 0.0)[:1].tolist():
        before, after = times_s[column], times_s[column + 1]
        raise WaypointError(
            f"data: expected times that increase (row 0), got {after:g} s in column {column + 1} after {before:g} s"
        )
    values, *derivatives = (matrix[1 + i * n : 1 + (i + 1) * n].T for i in range((rows - 1) // n))
    scalar_rows = list(dimensions.scalar_rows)
    rates, accelerations = (*(each[:, scalar_rows] for each in derivatives), None, None)[:2]
    quats = None
    if dimensions.rotation.is_path:
        quats = tuple(_quat_in(row, column, dimensions.rotation) for column, row in enumerate(values))
    elif dimensions.rotation.rotation_repr == "euler" and rates is not None:
        rates = rates.copy()  # as in the authors' release, these rows are ignored: they may be an angular velocity
        at = [scalar_rows.index(row) for row in dimensions.rotation.rows]
        rates[:, at] = estimated_rates(times_s, values[:, list(dimensions.rotation.rows)])
    return Waypoints(tuple(times_s.tolist()), values[:, scalar_rows], rates, accelerations, quats)


def estimated_rates(times_s: Sequence[float] | Array, values: Array) -> Array:
    """Estimates derivatives at K points for a smooth curve. The derivatives are zero at both ends.

    Args:
        times_s: K times [s].
        values: Values at these times, shape (K, S).

    Returns:
        Derivatives, shape (K, S).
    """
    rates = np.zeros_like(values)
    if len(values) > 2:
        h = np.diff(np.asarray(times_s))[:, np.newaxis]
        slopes = np.diff(values, axis=0) / h
        rates[1:-1] = (h[1:] * slopes[:-1] + h[:-1] * slopes[1:]) / (h[:-1] + h[1:])
    return rates


def _quat_in(values: Array, column: int, rotation: RotationConfig) -> Quaternion:
    try:
        return rotation.quat(values[list(rotation.rows)].tolist())
    except WaypointError as error:
        raise WaypointError(f"data: column {column}: {error}") from None
