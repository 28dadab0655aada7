"""Clocks that were set back during a recording."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from .row_plan import RECORD_TIME

Array = NDArray[Any]

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
