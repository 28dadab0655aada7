"""Windows of the operator's signal: the records of a time span, and messages of them as arrays."""

import math
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray


class SignalWindow:
    """Buffers the signals of a time span.

    Args:
        duration_s: Age beyond which signals are dropped [s].
        most: Largest number of signals; the oldest are dropped beyond it, so that a stopped clock cannot fill the
            memory.
    """

    def __init__(self, duration_s: float, most: int = 20_000) -> None:
        self._duration_s = duration_s
        self._records: deque[tuple[float, ...]] = deque(maxlen=most)

    @property
    def size(self) -> int:
        """Numbers per signal; 0 if there is none."""
        return len(self._records[0]) - 1 if self._records else 0

    def add(self, time_s: float, signal: Sequence[float]) -> None:
        """Adds the newest signal, at a time [s].

        All earlier signals are dropped if the size of the signal changes or time goes back, as it does when a
        simulation is restarted.

        Raises:
            ValueError: If the signal is empty or not finite; then nothing is added.
        """
        if not signal or not all(map(math.isfinite, (time_s, *signal))):
            raise ValueError(f"expected finite numbers, got {', '.join(f'{v:g}' for v in signal) or 'none'}")
        if self._records and (len(signal) != self.size or time_s < self._records[-1][0]):
            self._records.clear()
        self._records.append((time_s, *signal))
        self.forget(time_s)

    def forget(self, now_s: float) -> None:
        """Drops the signals that are too old at a time [s]."""
        while self._records and now_s - self._records[0][0] > self._duration_s:
            self._records.popleft()

    def data(self) -> list[float]:
        """Returns the records, each a time [s] and its signal, one after the other, oldest first."""
        return [value for record in self._records for value in record]


def reconstruct_interface_log_msg(msg: Any, Nd: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the times and signals of a message of `operator_node/window`.

    Args:
        msg: The message; its `data` are records of a time and a signal, one after the other.
        Nd: Numbers per signal.

    Returns:
        Times [s], shape (N,), oldest first, and signals, shape (Nd, N).

    Raises:
        ValueError: If the data are not records of this size.
    """
    data = np.asarray(msg.data, dtype=float)
    if Nd < 1 or data.size % (Nd + 1):
        raise ValueError(f"expected records of a time and {Nd} numbers, got {data.size} numbers altogether")
    records = data.reshape(-1, Nd + 1)
    return records[:, 0].copy(), records[:, 1:].T.copy()
