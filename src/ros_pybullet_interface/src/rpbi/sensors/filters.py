"""Operations on measured values: a low-pass filter, noise and the mean for zeroing."""

import math
from collections.abc import Sequence
from concurrent.futures import Future

import numpy as np
import numpy.typing as npt


class LowPass:
    """First-order low-pass filter, exact for an input that is constant during each tick.

    `y[n] = y[n-1] + (1 - exp(-2 pi f dt)) (x[n] - y[n-1])` is the zero-order-hold solution of `y' = 2 pi f (x - y)`.
    The first output is the first input.

    Args:
        cutoff_hz: Cutoff frequency f [Hz], at which the amplitude is reduced by the factor 1/sqrt(2).
        dt_s: Length of a tick [s].
    """

    def __init__(self, cutoff_hz: float, dt_s: float) -> None:
        self._gain = -math.expm1(-2.0 * math.pi * cutoff_hz * dt_s)
        self.output: npt.NDArray[np.float64] | None = None
        """The newest value, None before the first."""

    def step(self, value: npt.NDArray[np.float64]) -> None:
        """Filters the input value of the next tick, and stores the result in `output`."""
        self.output = value if self.output is None else self.output + self._gain * (value - self.output)


_TICKS_PER_BLOCK = 256


class SeededNoise:
    """Generates normally distributed noise with a bias; the values depend only on the seed and the tick.

    Args:
        seed: Seed, 0 or greater.
        deviation: Standard deviation of each of the n noise values.
        bias: Mean of each of the n noise values.
    """

    def __init__(self, seed: int, deviation: Sequence[float], bias: Sequence[float]) -> None:
        self._seed = seed
        self._deviation = np.array(deviation, float)
        self._bias = np.array(bias, float)
        self._is_noisy = bool(self._deviation.any())
        self._block_index = -1
        self._block = np.empty((0, len(deviation)))

    def at(self, tick: int) -> npt.NDArray[np.float64]:
        """Returns the noise of a tick, n values."""
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
    """Computes the mean of `count` samples; the mean becomes a sensor's new zero.

    Args:
        count: Number of samples.
    """

    def __init__(self, count: int) -> None:
        self.mean: Future[npt.NDArray[np.float64]] = Future()
        """The mean; another thread may wait for it."""
        self._left = self._count = count
        self._sum: npt.NDArray[np.float64] | float = 0.0

    def add(self, value: npt.NDArray[np.float64]) -> None:
        """Adds a sample; the last sample sets the result of `mean`."""
        self._sum = self._sum + value
        self._left -= 1
        if not self._left:
            self.mean.set_result(np.asarray(self._sum) / self._count)
