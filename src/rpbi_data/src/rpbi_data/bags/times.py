"""Times of messages: integers in nanoseconds, as stamps are, and clocks that were set back during a recording."""

from __future__ import annotations

from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from .row_plan import RECORD_TIME

Array = NDArray[Any]

PER_SECOND = 1_000_000_000
MAX_SECONDS = 4.5e9
"""Largest size of a time [s]: ROS has at most 2**32 s, and differences of two times fit into 63 bits."""


def to_seconds(nanoseconds: ArrayLike) -> Array:
    """Returns times as floats [s], each as `stamp.to_sec()` computes it.

    Args:
        nanoseconds: The times, int64, of any shape [ns].
    """
    seconds, rest = np.divmod(nanoseconds, PER_SECOND)
    return np.asarray(seconds + rest / 1e9)


def to_nanoseconds(seconds: ArrayLike) -> Array:
    """Returns times of the same shape, int64 [ns]; exact for stamps below 2**23 s (97 days).

    Args:
        seconds: The times, finite, of at most `MAX_SECONDS` [s].
    """
    whole = np.floor(np.asarray(seconds, float))
    rest = np.rint((np.asarray(seconds, float) - whole) * 1e9)
    return np.asarray(whole.astype(np.int64) * PER_SECOND + rest.astype(np.int64))


def resolution_ns(seconds: ArrayLike) -> int:
    """Returns the distance of neighbouring floats at the latest of some times [ns]: 0 up to 97 days, 239 since 2004."""
    distance = np.spacing(np.abs(np.asarray(seconds, float)).max(initial=0.0)) * 1e9
    return int(np.ceil(distance)) if distance > 1.0 else 0


def row_times(start: int, end: int, hz: float) -> Array:
    """Returns the times of a rate from the start on, at most the end, each rounded to its nearest nanosecond.

    Args:
        start: Time of the first row [ns].
        end: The end, not before the start [ns].
        hz: Rows a second.

    Returns:
        int64, shape (n,) [ns].
    """
    period = PER_SECOND / Fraction(hz)
    double, half = 2 * period.numerator, period.denominator  # k periods: k * double / (2 * half)
    count = (2 * (end - start) + 1) * half // double + 1
    rows = [start + (k * double + half) // (2 * half) for k in range(count)]
    return np.array([row for row in rows if row <= end], np.int64)


MAX_BACK_S = 1.0
"""Largest time by which stamps may run back against the order of recording [s]; publishers are never exactly
synchronous.
"""


class ClockStep(NamedTuple):
    """Times that run back against the order of recording.

    Attributes:
        time_s: Latest time before [s].
        back_s: Largest time by which later times are before that [s]; 0 if none is.
    """

    time_s: float
    back_s: float

    @property
    def is_fault(self) -> bool:
        """Whether the clock was set back, and messages are not only a little out of order."""
        return self.back_s > MAX_BACK_S

    def __str__(self) -> str:
        return f"its clock was set back by {self.back_s:.6g} s at {self.time_s:.9g} s"


def set_back(times: Array) -> ClockStep:
    """Returns the largest step back of times.

    Args:
        times: In the order of recording, shape (n,) [s].
    """
    latest = np.maximum.accumulate(times)
    back = latest - times
    if not back.any():
        return ClockStep(0.0, 0.0)
    worst = int(np.argmax(back))
    return ClockStep(float(latest[worst]), float(back[worst]))


def clock_of(table: pd.DataFrame) -> ClockStep:
    """Returns the largest step back of a table's stamps against the order of recording.

    Args:
        table: As `bag_to_dataframes` returns it. Stamps of different TF frames are not compared.
    """
    order = np.argsort(table[RECORD_TIME].to_numpy(), kind="stable")
    found = set_back(table.index.to_numpy()[order])
    if found.is_fault and "child" in table and (table["child"] != table["child"].iloc[0]).any():
        frames = (clock_of(rows) for _, rows in table.groupby("child", sort=False))
        return max(frames, key=lambda each: each.back_s)
    return found
