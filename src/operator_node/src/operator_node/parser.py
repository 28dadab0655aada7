"""Buffers the operator's signals over a time span, and converts window messages to arrays."""

import math
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray


class SignalWindow:
    """Buffers the newest signals within a time span.

    Args:
        duration_s: Age above which signals are dropped [s].
        most: Largest number of buffered signals. Beyond this number, the oldest signals are dropped, so that a stopped
            clock cannot fill the memory.
    """

    def __init__(self, duration_s: float, most: int = 20_000) -> None:
        self._duration_s = duration_s
        self._records: deque[tuple[float, ...]] = deque(maxlen=most)

    @property
    def size(self) -> int:
        """Number of values in each signal; 0 while the buffer is empty."""
        return len(self._records[0]) - 1 if self._records else 0

    def add(self, time_s: float, signal: Sequence[float]) -> None:
        """Adds a signal at a time [s].

        Drops all earlier signals if the size of the signal changes or time goes back, as after the restart of a
        simulation.

        Raises:
            ValueError: If the signal is empty or not finite. The buffer then stays unchanged.
        """
        if not signal or not all(map(math.isfinite, (time_s, *signal))):
            raise ValueError(f"expected finite numbers, got {', '.join(f'{v:g}' for v in signal) or 'none'}")
        if self._records and (len(signal) != self.size or time_s < self._records[-1][0]):
            self._records.clear()
        self._records.append((time_s, *signal))
        self.forget(time_s)

    def forget(self, now_s: float) -> None:
        """Drops the signals that are older than `duration_s` at the time `now_s` [s]."""
        while self._records and now_s - self._records[0][0] > self._duration_s:
            self._records.popleft()

    def data(self) -> list[float]:
        """Returns all records in one list, oldest first. Each record is a time [s] followed by the signal's values."""
        return [value for record in self._records for value in record]


def reconstruct_interface_log_msg(msg: Any, Nd: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the times and signals of a message of `operator_node/window`.

    Args:
        msg: Message whose `data` contain the records. Each record is a time [s] followed by `Nd` values.
        Nd: Number of values in each signal.

    Returns:
        Times [s], shape (N,), oldest first, and signals, shape (Nd, N).

    Raises:
        ValueError: If the length of the data is not a multiple of Nd + 1.
    """
    data = np.asarray(msg.data, dtype=float)
    if Nd < 1 or data.size % (Nd + 1):
        raise ValueError(f"expected records of a time and {Nd} numbers, got {data.size} numbers altogether")
    records = data.reshape(-1, Nd + 1)
    return records[:, 0].copy(), records[:, 1:].T.copy()
