"""Conversion of message times between seconds and integer nanoseconds, and detection of clocks that were set back."""

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
"""Largest absolute time [s]: ROS times are below 2**32 s, and differences of two times [ns] fit into 63 bits."""


def to_seconds(nanoseconds: ArrayLike) -> Array:
    """Converts times to floats [s], with the same rounding as `stamp.to_sec()`.

    Args:
        nanoseconds: Times, int64, of any shape [ns].
    """
    seconds, rest = np.divmod(nanoseconds, PER_SECOND)
    return np.asarray(seconds + rest / 1e9)


def to_nanoseconds(seconds: ArrayLike) -> Array:
    """Converts times to int64 [ns]; exact for stamps below 2**23 s (97 days).

    Args:
        seconds: Finite times of any shape, with absolute values of at most `MAX_SECONDS` [s].
    """
    whole = np.floor(np.asarray(seconds, float))
    rest = np.rint((np.asarray(seconds, float) - whole) * 1e9)
    return np.asarray(whole.astype(np.int64) * PER_SECOND + rest.astype(np.int64))


def resolution_ns(seconds: ArrayLike) -> int:
    """Returns the distance between neighbouring floats at the largest of the given times [ns].

    The distance is rounded up, but is 0 below 1 ns: 0 for times up to 97 days, and 239 ns for wall times since 2004.
    """
    distance = np.spacing(np.abs(np.asarray(seconds, float)).max(initial=0.0)) * 1e9
    return int(np.ceil(distance)) if distance > 1.0 else 0


def row_times(start: int, end: int, hz: float) -> Array:
    """Returns times at a constant rate from a start to an end, each rounded to the nearest nanosecond.

    Args:
        start: Time of the first row [ns].
        end: Upper limit of the times, not before `start` [ns].
        hz: Rows per second.

    Returns:
        Times, int64, shape (n,) [ns].
    """
    period = PER_SECOND / Fraction(hz)
    double, half = 2 * period.numerator, period.denominator  # k periods: k * double / (2 * half)
    count = (2 * (end - start) + 1) * half // double + 1
    rows = [start + (k * double + half) // (2 * half) for k in range(count)]
    return np.array([row for row in rows if row <= end], np.int64)


MAX_BACK_S = 1.0
"""Backward step of stamps, in the order of recording, above which the clock counts as set back [s].

Smaller steps occur because publishers are never exactly synchronous.
"""


class ClockStep(NamedTuple):
    """The largest backward step in a sequence of times, in the order of recording.

    Attributes:
        time_s: Latest time before the step [s].
        back_s: Size of the step [s]; 0 if times never go back.
    """

    time_s: float
    back_s: float

    @property
    def is_fault(self) -> bool:
        """Whether the step exceeds `MAX_BACK_S`, so that the clock must have been set back."""
        return self.back_s > MAX_BACK_S

    def __str__(self) -> str:
        return f"its clock was set back by {self.back_s:.6g} s at {self.time_s:.9g} s"


def set_back(times: Array) -> ClockStep:
    """Returns the largest backward step in a sequence of times.

    Args:
        times: Times in the order of recording, shape (n,) [s].
    """
    latest = np.maximum.accumulate(times)
    back = latest - times
    if not back.any():
        return ClockStep(0.0, 0.0)
    worst = int(np.argmax(back))
    return ClockStep(float(latest[worst]), float(back[worst]))


def clock_of(table: pd.DataFrame) -> ClockStep:
    """Returns the largest backward step of a table's stamps in the order of recording.

    In a table of transforms, stamps are compared only with stamps of the same child frame.

    Args:
        table: A table from `bag_to_dataframes`.
    """
    order = np.argsort(table[RECORD_TIME].to_numpy(), kind="stable")
    found = set_back(table.index.to_numpy()[order])
    if found.is_fault and "child" in table and (table["child"] != table["child"].iloc[0]).any():
        frames = (clock_of(rows) for _, rows in table.groupby("child", sort=False))
        return max(frames, key=lambda each: each.back_s)
    return found
