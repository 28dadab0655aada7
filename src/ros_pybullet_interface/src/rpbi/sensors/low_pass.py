"""A low-pass filter."""

from __future__ import annotations

import math

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
        """Takes the value of one more tick."""
        self.output = value if self.output is None else self.output + self._gain * (value - self.output)
