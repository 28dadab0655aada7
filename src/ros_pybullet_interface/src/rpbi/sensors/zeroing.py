"""Finding what a sensor shows when it should show zero."""

from __future__ import annotations

from concurrent.futures import Future

import numpy as np
import numpy.typing as npt


class Zeroing:
    """Averages the samples to come.

    Args:
        count: How many.
    """

    def __init__(self, count: int) -> None:
        self.mean: Future[npt.NDArray[np.float64]] = Future()
        """The mean, once it is known; another thread may wait for it."""
        self._left = self._count = count
        self._sum: npt.NDArray[np.float64] | float = 0.0

    def take(self, value: npt.NDArray[np.float64]) -> None:
        """Takes one more sample; the last one settles the mean."""
        self._sum = self._sum + value
        self._left -= 1
        if not self._left:
            self.mean.set_result(np.asarray(self._sum) / self._count)
