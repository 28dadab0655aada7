"""Basis functions of phase or time, and a least-squares fit of basis function weights to samples."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import null_space

from custom_ros_tools.transforms import Array

LAST_PHASE = 0.01
"""Phase at the end of a discrete primitive; the phase at the start is 1."""
DECAY = -math.log(LAST_PHASE)
"""Decay rate of the phase: phase = exp(-DECAY * time / duration)."""
OVERLAP = 0.8
"""Value of a Gaussian at the centre of the next Gaussian, before normalisation."""
RIDGE = 1e-10
"""Factor of the squared weights in the cost of `fitted` without `roughness`, relative to the sum of a basis function's
squared values."""
SMOOTHING = 1e-9
"""Factor of the roughness in the cost of `fitted` with `roughness`, relative to the sum of a basis function's squared
values."""


class GaussianBasis(NamedTuple):
    """Normalised Gaussians over a phase that decays from 1 (Ijspeert 2013, equation 2.3).

    Attributes:
        centers: Phases at the k centres.
        widths: k factors w in exp(-w * (phase - centre)^2).
    """

    centers: Array
    widths: Array

    @classmethod
    def of(cls, count: int) -> GaussianBasis:
        """Makes `count` Gaussians whose centres are equally spaced in time."""
        centers = np.exp(-DECAY * np.linspace(0.0, 1.0, count))
        widths = -math.log(OVERLAP) / np.diff(centers) ** 2
        return cls(centers, np.append(widths, widths[-1]))

    def values(self, progress: Array) -> Array:
        """Returns the values of the k basis functions, multiplied by the phase, shape (m, k).

        Args:
            progress: m times, as fractions of the duration.
        """
        phase = np.exp(-DECAY * np.asarray(progress))[..., None]
        values = np.exp(-self.widths * (phase - self.centers) ** 2)
        return np.asarray(phase * values / values.sum(axis=-1, keepdims=True))


class PeriodicBasis(NamedTuple):
    """Normalised von Mises functions over an angle (Ijspeert 2013, equation 2.9).

    Attributes:
        centers: k centres [rad].
        width: Factor w in exp(w * (cos(angle - centre) - 1)).
    """

    centers: Array
    width: float

    @classmethod
    def of(cls, count: int) -> PeriodicBasis:
        """Makes `count` functions whose centres are equally spaced over one period."""
        centers = np.linspace(0.0, 2.0 * math.pi, count, endpoint=False)
        return cls(centers, -math.log(OVERLAP) / (1.0 - math.cos(2.0 * math.pi / count)))

    def values(self, cycles: Array) -> Array:
        """Returns the values of the k basis functions, shape (m, k).

        Args:
            cycles: m times, as numbers of periods since the start.
        """
        angle = 2.0 * math.pi * np.asarray(cycles)[..., None]
        values = np.exp(self.width * (np.cos(angle - self.centers) - 1.0))
        return np.asarray(values / values.sum(axis=-1, keepdims=True))


class TimeBasis(NamedTuple):
    """Normalised Gaussians over time, which is a fraction of the duration (Paraschos 2013, equation 6).

    Attributes:
        centers: k centres, from 0 to 1.
        variance: Variance of each Gaussian.
    """

    centers: Array
    variance: float

    @classmethod
    def of(cls, count: int) -> TimeBasis:
        """Makes `count` Gaussians whose centres are equally spaced from 0 to 1."""
        return cls(np.linspace(0.0, 1.0, count), -1.0 / (8.0 * count**2 * math.log(0.7)))

    def values(self, progress: Array) -> Array:
        """Returns the values of the k basis functions, shape (m, k).

        Args:
            progress: m times, as fractions of the duration.
        """
        values = self._gaussians(progress)
        return np.asarray(values / values.sum(axis=-1, keepdims=True))

    def rates(self, progress: Array) -> Array:
        """Returns the derivatives of `values` with respect to `progress`, shape (m, k)."""
        values = self._gaussians(progress)
        rates = (self.centers - np.asarray(progress)[..., None]) / self.variance * values
        total = values.sum(axis=-1, keepdims=True)
        return np.asarray((rates - values * rates.sum(axis=-1, keepdims=True) / total) / total)

    @property
    def roughness(self) -> Array:
        """Matrix R of shape (k, k), such that w^T R w is the sum of squared second differences of the weights w."""
        bends = np.diff(np.eye(len(self.centers)), n=2, axis=0)
        return np.asarray(bends.T @ bends)

    def _gaussians(self, progress: Array) -> Array:
        distance = np.asarray(progress)[..., None] - self.centers
        return np.asarray(np.exp(-0.5 * distance**2 / self.variance))


def fitted(values: Array, samples: Array, conditions: Array | None = None, roughness: Array | None = None) -> Array:
    """Fits weights of basis functions to samples by least squares.

    Args:
        values: Values of the k basis functions at m samples, shape (m, k).
        samples: Samples of d signals, shape (m, d).
        conditions: Linear constraints, shape (c, k): `conditions @ w` is 0 for the weights w of each signal.
        roughness: Matrix of a smoothness prior, see `TimeBasis.roughness`. The prior determines weights that the
            samples do not determine. By default, small weights are preferred instead.

    Returns:
        Weights, shape (d, k).
    """
    free = np.eye(values.shape[1]) if conditions is None else null_space(conditions)
    inputs = values @ free
    square = inputs.T @ inputs
    largest = float(np.max(np.diag(square), initial=0.0))
    prior = RIDGE * np.eye(len(square)) if roughness is None else SMOOTHING * free.T @ roughness @ free
    return np.asarray((free @ np.linalg.solve(square + largest * prior, inputs.T @ samples)).T)
