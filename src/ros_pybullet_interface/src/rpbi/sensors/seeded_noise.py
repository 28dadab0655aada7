"""Noise that depends on nothing but a seed and the tick."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

_TICKS_PER_BLOCK = 256


class SeededNoise:
    """Normally distributed noise on top of a bias; the same at the same tick, whatever was read before.

    Args:
        seed: Seed, 0 or greater.
        deviation: n standard deviations.
        bias: n means.
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
