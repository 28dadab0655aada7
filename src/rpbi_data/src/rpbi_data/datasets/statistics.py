"""Statistics of features, as LeRobot stores them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
MAX_SAMPLED_FRAMES = 100
"""Largest number of images of an episode from which statistics are computed."""
LEVELS = 256
"""Number of values of a channel."""
MAX_SAMPLED_PIXELS = 20_000
"""Approximate number of pixels of each image from which statistics are computed, evenly spaced over the image."""


def statistics(values: Array) -> dict[str, list[Any]]:
    """Returns minimum, maximum, mean, standard deviation and quantiles of each column, and the number of rows.

    Args:
        values: Values of a feature, shape (n, columns).
    """
    values = values.astype(float)
    found = {"min": values.min(axis=0), "max": values.max(axis=0)}
    found |= {"mean": values.mean(axis=0), "std": values.std(axis=0)}
    levels = np.quantile(values, list(QUANTILES.values()), axis=0)
    found |= dict(zip(QUANTILES, levels))
    return {**{name: each.tolist() for name, each in found.items()}, "count": [len(values)]}


class ImageStatistics:
    """Computes statistics of each colour channel of an episode's images, from a sample of the images and pixels.

    Args:
        frames: Expected number of images.
    """

    def __init__(self, frames: int) -> None:
        self._every = max(1, -(-frames // MAX_SAMPLED_FRAMES))
        self._seen = 0
        self._sampled = 0
        self._counts = np.zeros((3, LEVELS), int)

    def add(self, pixels: Array) -> None:
        """Adds an image, shape (height, width, 3), uint8. Only a sample of the added images is evaluated."""
        if self._seen % self._every == 0:
            step = max(1, int(np.sqrt(pixels.shape[0] * pixels.shape[1] / MAX_SAMPLED_PIXELS)))
            for channel, counts in enumerate(self._counts):
                counts += np.bincount(pixels[::step, ::step, channel].ravel(), minlength=LEVELS)
            self._sampled += 1
        self._seen += 1

    def result(self) -> dict[str, list[Any]]:
        """Returns the statistics of channel values, scaled to [0, 1], each as a nested list of the shape (3, 1, 1)."""
        levels = np.arange(LEVELS) / (LEVELS - 1)
        found: dict[str, list[Any]] = {}
        for counts in self._counts:
            total = counts.sum()
            mean = (counts * levels).sum() / total
            there = levels[counts > 0]
            by_name = {"min": there[0], "max": there[-1], "mean": mean}
            by_name["std"] = np.sqrt((counts * (levels - mean) ** 2).sum() / total)
            shares = np.cumsum(counts) / total
            by_name |= {name: levels[np.searchsorted(shares, share)] for name, share in QUANTILES.items()}
            for name, value in by_name.items():
                found.setdefault(name, []).append([[float(value)]])
        return {**found, "count": [self._sampled]}


def pooled(parts: list[dict[str, list[Any]]]) -> dict[str, list[Any]]:
    """Combines image statistics of several episodes.

    Quantiles of the result are means of the episodes' quantiles, weighted by `count`.
    """
    counts = np.array([part["count"][0] for part in parts], float)
    arrays = {name: np.array([part[name] for part in parts]) for name in parts[0] if name != "count"}

    def mean(values: Array) -> Array:
        return np.asarray(np.average(values, axis=0, weights=counts))

    total = mean(arrays["mean"])
    found = {"min": arrays["min"].min(axis=0), "max": arrays["max"].max(axis=0), "mean": total}
    found["std"] = np.sqrt(mean(arrays["std"] ** 2 + (arrays["mean"] - total) ** 2))
    found |= {name: mean(arrays[name]) for name in QUANTILES}
    return {**{name: each.tolist() for name, each in found.items()}, "count": [int(counts.sum())]}
