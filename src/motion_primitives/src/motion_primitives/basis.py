"""Basis functions over the phase, and the weights that fit them to samples."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import null_space

from custom_ros_tools.transforms import Array

LAST_PHASE = 0.01
"""Phase of a discrete primitive at its end; it is 1 at its start."""
DECAY = -math.log(LAST_PHASE)
"""Rate at which the phase decays, per duration."""
OVERLAP = 0.8
"""Value of a Gaussian at the centre of the next one."""
RIDGE = 1e-10
"""Weight of the squared weights against the squared errors of a fit, relative to the largest basis function."""
SMOOTHING = 1e-9
"""Weight of the roughness against the squared errors of a fit, relative to the largest basis function."""


class GaussianBasis(NamedTuple):
    """Normalised Gaussians of a phase that decays from 1 (Ijspeert 2013, equation 2.3).

    Attributes:
        centers: k centres.
        widths: k factors of the squared distance.
    """

    centers: Array
    widths: Array

    @classmethod
    def of(cls, count: int) -> GaussianBasis:
        """Returns Gaussians at equal distances in time."""
        centers = np.exp(-DECAY * np.linspace(0.0, 1.0, count))
        widths = -math.log(OVERLAP) / np.diff(centers) ** 2
        return cls(centers, np.append(widths, widths[-1]))

    def values(self, progress: Array) -> Array:
        """Returns the basis functions times the phase, shape (m, k), at m shares of the duration."""
        phase = np.exp(-DECAY * np.asarray(progress))[..., None]
        values = np.exp(-self.widths * (phase - self.centers) ** 2)
        return np.asarray(phase * values / values.sum(axis=-1, keepdims=True))


class PeriodicBasis(NamedTuple):
    """Normalised von Mises functions of an angle (Ijspeert 2013, equation 2.9).

    Attributes:
        centers: k centres [rad].
        width: Factor of the cosine.
    """

    centers: Array
    width: float

    @classmethod
    def of(cls, count: int) -> PeriodicBasis:
        """Returns functions at equal distances."""
        centers = np.linspace(0.0, 2.0 * math.pi, count, endpoint=False)
        return cls(centers, -math.log(OVERLAP) / (1.0 - math.cos(2.0 * math.pi / count)))

    def values(self, cycles: Array) -> Array:
        """Returns the basis functions, shape (m, k), after m numbers of cycles."""
        angle = 2.0 * math.pi * np.asarray(cycles)[..., None]
        values = np.exp(self.width * (np.cos(angle - self.centers) - 1.0))
        return np.asarray(values / values.sum(axis=-1, keepdims=True))


class TimeBasis(NamedTuple):
    """Normalised Gaussians of the share of the duration that has passed (Paraschos 2013, equation 6).

    Attributes:
        centers: k centres, from 0 to 1.
        variance: Square of their width.
    """

    centers: Array
    variance: float

    @classmethod
    def of(cls, count: int) -> TimeBasis:
        """Returns Gaussians at equal distances."""
        return cls(np.linspace(0.0, 1.0, count), -1.0 / (8.0 * count**2 * math.log(0.7)))

    def values(self, progress: Array) -> Array:
        """Returns the basis functions, shape (m, k), at m shares of the duration."""
        values = self._gaussians(progress)
        return np.asarray(values / values.sum(axis=-1, keepdims=True))

    def rates(self, progress: Array) -> Array:
        """Returns their derivatives by the share of the duration, shape (m, k)."""
        values = self._gaussians(progress)
        rates = (self.centers - np.asarray(progress)[..., None]) / self.variance * values
        total = values.sum(axis=-1, keepdims=True)
        return np.asarray((rates - values * rates.sum(axis=-1, keepdims=True) / total) / total)

    @property
    def roughness(self) -> Array:
        """Matrix of the squared second differences of weights, shape (k, k); straight lines have none."""
        bends = np.diff(np.eye(len(self.centers)), n=2, axis=0)
        return np.asarray(bends.T @ bends)

    def _gaussians(self, progress: Array) -> Array:
        distance = np.asarray(progress)[..., None] - self.centers
        return np.asarray(np.exp(-0.5 * distance**2 / self.variance))


def fitted(values: Array, samples: Array, conditions: Array | None = None, roughness: Array | None = None) -> Array:
    """Returns weights with the least squared error.

    Args:
        values: Basis functions at m samples, shape (m, k).
        samples: Samples of d signals, shape (m, d).
        conditions: Rows that are 0 for all weights, shape (c, k).
        roughness: Matrix of a smooth prior of the weights, shape (k, k): it determines what samples leave open.

    Returns:
        Weights, shape (d, k).
    """
    free = np.eye(values.shape[1]) if conditions is None else null_space(conditions)
    inputs = values @ free
    square = inputs.T @ inputs
    largest = float(np.max(np.diag(square), initial=0.0))
    prior = RIDGE * np.eye(len(square)) if roughness is None else SMOOTHING * free.T @ roughness @ free
    return np.asarray((free @ np.linalg.solve(square + largest * prior, inputs.T @ samples)).T)
