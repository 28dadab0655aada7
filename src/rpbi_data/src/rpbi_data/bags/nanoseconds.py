"""Times as integers: samples are assigned to rows in nanoseconds, like stamps."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
