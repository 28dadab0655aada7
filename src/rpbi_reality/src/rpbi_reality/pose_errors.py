"""Differences between poses, and means with bootstrap intervals."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


def unit_quaternions(quaternions: np.ndarray) -> np.ndarray:
    """Scales quaternions to norm 1 and makes consecutive signs agree, shape (n, 4)."""
    scaled = quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True)
    if scaled.ndim < 2 or len(scaled) < 2:
        return scaled
    signs = np.where((scaled[1:] * scaled[:-1]).sum(-1) < 0.0, -1.0, 1.0)
    return scaled * np.cumprod(np.r_[1.0, signs])[:, None]


def angle_deg(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Returns the angles [deg] between orientations.

    Args:
        a: Quaternions x, y, z, w of any norm, shape (n, 4).
        b: Other quaternions, same shape.
    """
    a = a / np.linalg.norm(a, axis=-1, keepdims=True)
    b = b / np.linalg.norm(b, axis=-1, keepdims=True)
    chord = np.minimum(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
    return np.degrees(4.0 * np.arcsin(np.minimum(chord / 2.0, 1.0)))


def rotated(quaternions: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Rotates a vector by quaternions x, y, z, w.

    Args:
        quaternions: Unit quaternions, shape (4,) or (n, 4).
        vector: Vectors, shape (3,) or (n, 3).
    """
    axis, scalar = quaternions[..., :3], quaternions[..., 3:]
    return vector + 2.0 * np.cross(axis, np.cross(axis, vector) + scalar * vector)


class Interval(NamedTuple):
    """A mean, and the 95 % interval of this mean."""

    mean: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.mean:.1f} [{self.low:.1f}, {self.high:.1f}]"


def bootstrap(values: np.ndarray, rounds: int = 2000, seed: int = 0) -> Interval:
    """Returns the mean of values, and the percentile bootstrap interval of the mean (Efron 1979).

    Args:
        values: One value for each run, shape (n,).
        rounds: Number of resamples.
        seed: Seed of the resampling.
    """
    values = np.asarray(values, float)
    random = np.random.default_rng(seed)
    means = values[random.integers(0, len(values), (rounds, len(values)))].mean(1)
    low, high = np.percentile(means, (2.5, 97.5))
    return Interval(float(values.mean()), float(low), float(high))
