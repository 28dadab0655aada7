"""Resamples tables with different rates, so that the rows of all tables have the same times."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from custom_ros_tools.errors import UnknownNameError

from .row_plan import INDEX
from .times import MAX_SECONDS, resolution_ns, row_times, to_nanoseconds, to_seconds

Array = NDArray[Any]

TIME_ERROR = "time_error"
"""Name of the column with the time between a row and the nearest sample from which the row was computed [s]."""
_QUATERNION = "xyzw"


class Aligned(NamedTuple):
    """Several tables, resampled at common times.

    Attributes:
        table: Columns `NAME/COLUMN` of all tables; the index is `time` [s].
        max_time_error_s: Largest `time_error` (see `resample`) of each table [s], indexed by table name; NaN if no row
            of the table has a value.
    """

    table: pd.DataFrame
    max_time_error_s: pd.Series


def align(
    tables: Mapping[str, pd.DataFrame],
    *,
    to: str | None = None,
    hz: float | None = None,
    times: ArrayLike | None = None,
    method: str | Mapping[str, str] = "linear",
    max_time_error_s: float = np.inf,
) -> Aligned:
    """Resamples tables at common times, which exactly one of `to`, `hz` and `times` defines.

    Args:
        tables: Tables whose times belong to the same clock, indexed by any name; for instance from `bag_to_dataframes`.
        to: Name of the table at whose times the other tables are resampled.
        hz: Rate of the times, which cover the range that all tables have in common [Hz].
        times: The times, ascending, shape (n,) [s].
        method: Method for all tables, or a method for each table name; see `resample`. The default is `linear`.
        max_time_error_s: See `resample`.

    Raises:
        ValueError: If `tables` is empty, not exactly one of `to`, `hz` and `times` is given, or the tables have no
            range in common.
        UnknownNameError: If a table or a method does not exist.
    """
    if not tables:
        raise ValueError("expected at least one table, got none")
    if sum(each is not None for each in (to, hz, times)) != 1:
        raise ValueError("expected exactly one of 'to', 'hz' and 'times'")
    methods = dict.fromkeys(tables, method) if isinstance(method, str) else dict(method)
    for name in [*methods, *([to] if to is not None else [])]:
        if name not in tables:
            raise UnknownNameError("table", name, tables)
    if to is not None:
        wanted = np.unique(tables[to].index.to_numpy())
    elif hz is not None:
        wanted = to_seconds(_common_times(tables, hz))
    else:
        wanted = np.asarray(times, float)
    resampled = {
        name: resample(table, wanted, methods.get(name, "linear"), max_time_error_s) for name, table in tables.items()
    }
    errors = pd.Series({name: table[TIME_ERROR].max() for name, table in resampled.items()}, name="max_time_error_s")
    return Aligned(pd.concat([table.add_prefix(f"{name}/") for name, table in resampled.items()], axis=1), errors)


def resample(
    table: pd.DataFrame, times: ArrayLike, method: str = "linear", max_time_error_s: float = np.inf
) -> pd.DataFrame:
    """Returns the values of a table at other times.

    Each column is computed from its own samples; rows in which the column is NaN or None are skipped. If several
    samples have the same time, the last one is used. With `previous` and `linear`, a column has no value before its
    first sample; with `linear`, it also has no value after its last sample. Times are compared as integer nanoseconds.
    Times that floats cannot distinguish count as equal; in wall time, these differ by up to 0.24 us.

    Args:
        table: A table with the index `time` [s], ascending.
        times: Times of the new rows, shape (n,), ascending [s].
        method: `nearest`, `previous` or `linear`. With `linear`, columns `PATH/x`, `PATH/y`, `PATH/z`, `PATH/w` are
            a quaternion, which is interpolated by slerp, and texts and booleans take the previous value.
        max_time_error_s: Largest time between a row and the nearest sample used [s]. Values from samples further away
            are replaced by NaN or None.

    Returns:
        A table with the same columns, in which numbers are floats, and the last column `time_error` [s]. For each value
        in a row, the error is the time between the row and the nearest sample used. `time_error` is the row's largest.

    Raises:
        UnknownNameError: If the method does not exist.
        ValueError: If times are not ascending and finite, or a quaternion is zero.
    """
    wanted, known = _checked_times(times, "times"), _checked_times(table.index, "index of the table")
    known_ns = to_nanoseconds(known)
    rows = _snapped(to_nanoseconds(wanted), known_ns, resolution_ns([*wanted[-1:], *known[-1:]]))
    resampled = resample_exactly(table.set_axis(known_ns), rows, method, max_time_error_s)
    return resampled.set_axis(pd.Index(wanted, name=INDEX))


def resample_exactly(
    table: pd.DataFrame, times: Array, method: str = "linear", max_time_error_s: float = np.inf
) -> pd.DataFrame:
    """Returns the values of a table at other times, like `resample`, but index and times are int64 [ns]."""
    if method not in _METHODS:
        raise UnknownNameError("method", method, _METHODS)
    known = table.index.to_numpy()
    values: dict[str, Array] = {}
    largest = np.full(len(times), np.nan)
    for names in _groups(table.columns, method):
        is_there = np.flatnonzero(~table[names].isna().to_numpy().any(axis=1))
        is_last = np.append(np.diff(known[is_there]) > 0, True)[: len(is_there)]  # among samples with equal times
        rows = is_there[is_last]
        samples = table[names].to_numpy()[rows]
        if len(names) > 1 and not samples.any(axis=1).all():
            raise ValueError(f"{', '.join(names)}: expected unit quaternions, got one of zeros")
        new, error = _METHODS[method](known[rows], samples, times)
        is_far = ~(error <= max_time_error_s)
        new[is_far] = None if new.dtype == object else np.nan
        largest = np.fmax(largest, np.where(is_far, np.nan, error))
        values |= zip(names, new.T, strict=True)
    columns = {name: values[name] for name in table.columns}
    return pd.DataFrame({**columns, TIME_ERROR: largest}, index=pd.Index(times, name=INDEX))


def _checked_times(times: ArrayLike | pd.Index, name: str) -> Array:
    checked = np.asarray(times, float)
    if checked.ndim != 1 or not np.isfinite(checked).all() or (np.diff(checked) < 0).any():
        raise ValueError(f"{name}: expected ascending, finite seconds in one dimension")
    if (np.abs(checked) > MAX_SECONDS).any():
        raise ValueError(
            f"{name}: expected seconds of at most {MAX_SECONDS:g}, got {checked[np.abs(checked).argmax()]:g}"
        )
    return checked


def _snapped(times: Array, known: Array, resolution: int) -> Array:
    """Replaces each time that differs from a known time by at most `resolution` [ns] by this known time."""
    if not len(known):
        return times
    newest = known[np.searchsorted(known, times + resolution, side="right") - 1]
    return np.where(np.abs(times - newest) <= resolution, newest, times)


def _common_times(tables: Mapping[str, pd.DataFrame], hz: float) -> Array:
    """Returns times at a constant rate over the range that all tables have in common, int64 [ns]."""
    if not (np.isfinite(hz) and hz > 0):
        raise ValueError(f"hz: expected a positive rate, got {hz}")
    empty = [name for name, table in tables.items() if not len(table)]
    if empty:
        raise ValueError(f"'{empty[0]}' has no rows")
    start = max(table.index[0] for table in tables.values())
    end = min(table.index[-1] for table in tables.values())
    if end < start:
        raise ValueError(f"the tables have no time in common: one begins at {start} s, another ends at {end} s")
    return row_times(int(to_nanoseconds(start)), int(to_nanoseconds(end)), hz)


def _groups(columns: Sequence[str], method: str) -> Iterator[list[str]]:
    """Yields groups of columns that are interpolated together: the four columns of a quaternion, or a single column."""
    every = set(columns)
    for name in columns:
        prefix, _, last = name.rpartition("/")
        group = [f"{prefix}/{axis}" for axis in _QUATERNION]
        if method != "linear" or last not in _QUATERNION or not every.issuperset(group):
            yield [name]
        elif last == "x":
            yield group


Resampled = tuple[Array, Array]
"""New values, shape (n, columns), and times to the nearest sample used, shape (n,) [s]; NaN for missing values."""


def _previous(known: Array, samples: Array, wanted: Array) -> Resampled:
    index = np.searchsorted(known, wanted, side="right") - 1
    return _picked(known, samples, wanted, index)


def _nearest(known: Array, samples: Array, wanted: Array) -> Resampled:
    index = np.searchsorted(known[:-1] + np.diff(known) // 2, wanted)
    return _picked(known, samples, wanted, index if len(known) else index - 1)


def _picked(known: Array, samples: Array, wanted: Array, index: Array) -> Resampled:
    """Returns, for each wanted time, the sample with the given index, or a missing value if the index is -1."""
    is_there = index >= 0
    is_number = samples.dtype.kind in "iuf"
    new = np.full((len(wanted), samples.shape[1]), np.nan if is_number else None, float if is_number else object)
    error = np.full(len(wanted), np.nan)
    new[is_there] = samples[index[is_there]]
    error[is_there] = np.abs(wanted[is_there] - known[index[is_there]]) / 1e9
    return new, error


def _linear(known: Array, samples: Array, wanted: Array) -> Resampled:
    if samples.dtype.kind not in "iuf":
        return _previous(known, samples, wanted)
    new, error = np.full((len(wanted), samples.shape[1]), np.nan), np.full(len(wanted), np.nan)
    inside = (known[0] <= wanted) & (wanted <= known[-1]) if len(known) else np.zeros(len(wanted), bool)
    at = wanted[inside]
    left = np.clip(np.searchsorted(known, at, side="right") - 1, 0, max(len(known) - 2, 0))
    right = np.minimum(left + 1, len(known) - 1)
    before, after = at - known[left], known[right] - at
    share = np.divide(before, before + after, out=np.zeros(len(at)), where=before + after > 0)
    if samples.shape[1] == len(_QUATERNION):
        new[inside] = _slerp(samples[left], samples[right], share)
    else:
        new[inside] = (1.0 - share[:, None]) * samples[left] + share[:, None] * samples[right]
    error[inside] = np.minimum(before, after) / 1e9
    return new, error


def _slerp(start: Array, end: Array, share: Array) -> Array:
    """Interpolates between unit quaternions, shape (n, 4), along the shortest rotation.

    A share of 0 gives `start`, and a share of 1 gives `end`. The sign of each result is chosen such that the result is
    nearest to `start`.
    """
    first = Rotation.from_quat(start)
    whole = (first.inv() * Rotation.from_quat(end)).as_rotvec()
    quats = (first * Rotation.from_rotvec(share[:, None] * whole)).as_quat()
    return quats * np.where((quats * start).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)


_METHODS: dict[str, Callable[[Array, Array, Array], Resampled]] = {
    "nearest": _nearest,
    "previous": _previous,
    "linear": _linear,
}
