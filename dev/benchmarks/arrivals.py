"""Rates, latencies and losses from the arrivals of stamped messages."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt


class Arrivals(NamedTuple):
    """Messages of one topic as another process received them.

    Attributes:
        arrival_s: Wall times [s] at which its callback began, shape (n,).
        stamp_ns: Stamps of the messages [ns], shape (n,).
        processor_s: Processor time of the main thread of the process that was named [s], shape (n,); zeros without
            one.
    """

    arrival_s: npt.NDArray[np.float64]
    stamp_ns: npt.NDArray[np.int64]
    processor_s: npt.NDArray[np.float64]

    @property
    def rate_hz(self) -> float:
        """Messages a second of wall time, 0 if there were fewer than two."""
        return float((len(self.arrival_s) - 1) / self._wall_s) if len(self.arrival_s) > 1 else 0.0

    @property
    def real_time_factor(self) -> float:
        """Stamped seconds a second of wall time."""
        return float((self.stamp_ns[-1] - self.stamp_ns[0]) * 1e-9 / self._wall_s)

    @property
    def processor_share(self) -> float:
        """Processor time a stamped second [s]."""
        return float((self.processor_s[-1] - self.processor_s[0]) / ((self.stamp_ns[-1] - self.stamp_ns[0]) * 1e-9))

    @property
    def _wall_s(self) -> float:
        return float(self.arrival_s[-1] - self.arrival_s[0])

    def lateness_ms(self, percentile: float) -> float:
        """Returns the lateness of messages relative to the grid of their stamps [ms].

        The earliest message defines the offset of the grid, so lateness is relative to the best case.

        Args:
            percentile: Percentile of the lateness.
        """
        late_s = self.arrival_s - (self.stamp_ns - self.stamp_ns[0]) * 1e-9
        return float(np.percentile(late_s - late_s.min(), percentile)) * 1e3


def load(path: Path) -> dict[str, Arrivals]:
    """Reads the output of `programs/watch.py`, by topic."""
    with np.load(path) as data:
        topics = {name.split(" ")[0] for name in data.files}
        return {
            topic: Arrivals(data[f"{topic} arrival_s"], data[f"{topic} stamp_ns"], data[f"{topic} processor_s"])
            for topic in topics
        }
