"""Collects the samples of a live plot's lines, and returns the samples in the visible time span."""

from __future__ import annotations

import re
import threading
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

MAX_SAMPLES = 120_000
"""Number of newest samples that a line keeps: two minutes at 1 kHz."""
ANEW_S = 1.0
"""If a sample is older than the newest sample by more than this time, all lines restart [s].

Samples that are out of order by less are dropped.
"""

_UNITS = {
    "position": "rad or m",
    "velocity": "rad/s or m/s",
    "effort": "N m or N",
    "force": "N",
    "normal_force": "N",
    "torque": "N m",
    "translation": "m",
    "linear": "m/s",
    "angular": "rad/s",
    "angular_velocity": "rad/s",
    "linear_acceleration": "m/s^2",
}
"""Units, keyed by the field's name."""
_VECTORS = {"position": "m", "velocity": "m/s"}
"""Units of fields with components x, y and z, where they differ from `_UNITS`."""


class Line(NamedTuple):
    """A visible line, or the reason why a line is missing.

    Attributes:
        name: Topic and field of the line. For a missing line, the name that the user gave.
        times: Times of the samples [s], ascending, shape (N,).
        values: Values of the samples, shape (N,).
        note: Reason why the line is missing; empty for a visible line.
        number: Index of the line in the order of creation. It selects the colour.
    """

    name: str
    times: Array
    values: Array
    note: str
    number: int = 0

    @property
    def unit(self) -> str:
        """Unit of the values, derived from the field's name; empty if the name is not a known quantity."""
        *_, field, last = ["", "", *re.findall(r"\w+", self.name)]  # the last part may be the name of a joint
        if last in ("x", "y", "z") and field in _VECTORS:
            return _VECTORS[field]
        return _UNITS.get(field, _UNITS.get(last, ""))


class _Samples:
    """Buffer of a line's newest samples. `rank` orders the lines in the plot, `number` selects the colour."""

    def __init__(self, rank: int, number: int) -> None:
        self.rank, self.number = rank, number
        self._times, self._values = np.empty(2 * MAX_SAMPLES), np.empty(2 * MAX_SAMPLES)
        self._end = 0

    def append(self, time_s: float, value: float) -> None:
        if self._end and time_s < self._times[self._end - 1]:
            return
        if self._end == len(self._times):
            self._times[:MAX_SAMPLES], self._values[:MAX_SAMPLES] = (
                self._times[-MAX_SAMPLES:],
                self._values[-MAX_SAMPLES:],
            )
            self._end = MAX_SAMPLES
        self._times[self._end], self._values[self._end] = time_s, value
        self._end += 1

    def since(self, start_s: float) -> tuple[Array, Array]:
        """Returns copies of times [s] and values from `start_s` [s] on, including the last sample before `start_s`."""
        times = self._times[: self._end]
        first = max(0, int(np.searchsorted(times, start_s)) - 1)
        return times[first:].copy(), self._values[first : self._end].copy()


class LivePlot:
    """Lines of a plot, keyed by name. Several threads may add samples while another thread reads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._samples: dict[str, _Samples] = {}
        self._notes: dict[str, str] = {}
        self._newest_s = -np.inf
        self.count = 0
        """Number of samples that were added so far."""
        self.changes = 0
        """Number of changes of the visible data so far."""

    def add(self, name: str, time_s: float, value: float, rank: int = 0) -> None:
        """Appends a sample to a line, and creates the line if necessary.

        If time goes back by more than `ANEW_S`, all older samples of all lines are dropped.

        Args:
            name: Name of the line.
            time_s: Time of the sample [s].
            value: Value of the sample.
            rank: Sort key of the line. Lines with smaller ranks come first.
        """
        with self._lock:
            if time_s < self._newest_s - ANEW_S:
                self._samples.clear()
                self._newest_s = time_s
            self._newest_s = max(self._newest_s, time_s)
            samples = self._samples.get(name)
            if samples is None:
                samples = self._samples[name] = _Samples(rank, len(self._samples))
            samples.append(time_s, value)
            self.count += 1
            self.changes += 1

    def note(self, name: str, text: str) -> None:
        """Sets the reason why the lines for a user-given name get no samples. An empty text removes the reason."""
        with self._lock:
            if self._notes.get(name, "") != text:
                self._notes[name] = text
                self.changes += 1

    def clear(self) -> None:
        """Drops all samples."""
        with self._lock:
            self._samples.clear()
            self.changes += 1

    def view(self, seconds: float) -> tuple[float, list[Line]]:
        """Returns the time of the newest sample [s], and the lines: missing lines first, then lines with samples.

        Args:
            seconds: Length of the visible time span before the newest sample [s].
        """
        with self._lock:
            end_s = self._newest_s if np.isfinite(self._newest_s) else 0.0
            empty = np.empty(0)
            faults = [Line(name, empty, empty, text) for name, text in self._notes.items() if text]
            ranked = sorted(self._samples.items(), key=lambda each: each[1].rank)
            lines = [Line(name, *each.since(end_s - seconds), "", each.number) for name, each in ranked]
        return end_s, [*faults, *lines]


def thinned(times: Array, values: Array, start_s: float, end_s: float, columns: int) -> tuple[Array, Array]:
    """Reduces many samples to the lowest and highest value in each pixel column. The drawn line looks the same.

    Args:
        times: Times of the samples [s], ascending, shape (N,).
        values: Values of the samples, shape (N,).
        start_s: Time of the left edge [s].
        end_s: Time of the right edge [s].
        columns: Width of the picture [px].

    Returns:
        Horizontal positions [px] and values of the remaining points.
    """
    places = (times - start_s) * (columns / (end_s - start_s))
    if len(places) <= 2 * columns:
        return places, values
    first = np.flatnonzero(np.diff(np.floor(places), prepend=-np.inf))
    lowest, highest = np.fmin.reduceat(values, first), np.fmax.reduceat(values, first)
    return np.repeat(places[first], 2), np.column_stack([lowest, highest]).ravel()


def ticks(low: float, high: float, count: float) -> tuple[list[float], int]:
    """Returns evenly spaced round numbers for the marks of an axis, and the number of decimals to print.

    Args:
        low: Lower end of the axis.
        high: Upper end of the axis, above `low`.
        count: Largest number of intervals between marks.
    """
    raw = (high - low) / count
    power = 10.0 ** np.floor(np.log10(raw))
    step = float(next(each * power for each in (1, 2, 5, 10) if each * power >= raw * (1 - 1e-9)))
    first, last = int(np.ceil(low / step - 1e-9)), int(np.floor(high / step + 1e-9))
    return [number * step for number in range(first, last + 1)], max(0, -int(np.floor(np.log10(step) + 1e-9)))
