"""Filters of measured values: low pass, noise and zero."""

import math
from collections.abc import Sequence
from concurrent.futures import Future

import numpy as np
import numpy.typing as npt


class LowPass:
    """First-order low-pass, exact for an input that is constant over each tick.

    `y[n] = y[n-1] + (1 - exp(-2 pi f dt)) (x[n] - y[n-1])`: the zero-order-hold solution of `y' = 2 pi f (x - y)`. It
    starts at its first input.

    Args:
        cutoff_hz: Frequency at which 1/sqrt(2) of the amplitude passes [Hz].
        dt_s: Length of a tick [s].
    """

    def __init__(self, cutoff_hz: float, dt_s: float) -> None:
        self._gain = -math.expm1(-2.0 * math.pi * cutoff_hz * dt_s)
        self.output: npt.NDArray[np.float64] | None = None
        """The newest value, None before the first."""

    def step(self, value: npt.NDArray[np.float64]) -> None:
        """Adds the value of one tick."""
        self.output = value if self.output is None else self.output + self._gain * (value - self.output)


_TICKS_PER_BLOCK = 256


class SeededNoise:
    """Normally distributed noise and a bias; the values depend only on seed and tick.

    Args:
        seed: Seed, 0 or greater.
        deviation: Standard deviation of each of n values.
        bias: Mean of each.
    """

    def __init__(self, seed: int, deviation: Sequence[float], bias: Sequence[float]) -> None:
        self._seed = seed
        self._deviation = np.array(deviation, float)
        self._bias = np.array(bias, float)
        self._is_noisy = bool(self._deviation.any())
        self._block_index = -1
        self._block = np.empty((0, len(deviation)))

    def at(self, tick: int) -> npt.NDArray[np.float64]:
        """Returns the n values of a tick."""
        if not self._is_noisy:
            return self._bias
        index, row = divmod(tick, _TICKS_PER_BLOCK)  # drawn in blocks, since making a generator takes 20 us
        if index != self._block_index:
            shape = _TICKS_PER_BLOCK, len(self._deviation)
            standard = np.random.default_rng((self._seed, index)).standard_normal(shape)
            self._block = self._bias + self._deviation * standard
            self._block_index = index
        values: npt.NDArray[np.float64] = self._block[row]
        return values


class Zeroing:
    """Averages the next `count` samples."""

    def __init__(self, count: int) -> None:
        self.mean: Future[npt.NDArray[np.float64]] = Future()
        """The mean; another thread may wait for it."""
        self._left = self._count = count
        self._sum: npt.NDArray[np.float64] | float = 0.0

    def add(self, value: npt.NDArray[np.float64]) -> None:
        """Adds a sample; the last one sets the mean."""
        self._sum = self._sum + value
        self._left -= 1
        if not self._left:
            self.mean.set_result(np.asarray(self._sum) / self._count)
