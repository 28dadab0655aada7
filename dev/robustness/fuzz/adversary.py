"""Hostile targets of every kind."""

from __future__ import annotations

import math
from collections.abc import Generator
from typing import NamedTuple

import numpy as np

from .scenes import PERIOD_S


class Target(NamedTuple):
    """A target, and its stamp."""

    position: tuple[float, ...]
    age_s: float = 0.0
    step_s: float | None = None


def adversary(
    generator: np.random.Generator, lower: np.ndarray, upper: np.ndarray, count: int, calm: float
) -> Generator[Target, np.ndarray, None]:
    """Yields targets of every bad kind, with ordinary ones in between.

    It is sent the last three commands, 3 x n; before the first target, to be started, nothing.

    Args:
        generator: What it is random by.
        lower: The least n positions of the robot [rad].
        upper: The greatest.
        count: How many.
        calm: Share of ordinary ones; they keep the limits of joints, at most times.
    """
    n = len(lower)
    at, far, stay = np.zeros(n), np.zeros(n), 0
    velocity, acceleration = np.zeros(n), np.zeros(n)
    age_s, step_s, size = 0.0, None, n
    for _ in range(count):
        rows = yield Target((*at.tolist(), 0.0)[:size], age_s, step_s)
        age_s, step_s, size, stay = 0.0, None, n, stay - 1
        at = rows[-1]
        velocity = (rows[-1] - rows[-2]) / PERIOD_S
        acceleration = (velocity - (rows[-2] - rows[-3]) / PERIOD_S) / PERIOD_S
        if stay > 0:
            at = far
        elif generator.random() < calm:
            wanted = 20.0 * generator.normal(size=n) * (generator.random() < 0.1) + 0.95 * acceleration - 0.5 * velocity
            acceleration = np.clip(wanted, acceleration - 1.9, acceleration + 1.9).clip(-7.8, 7.8)
            velocity = velocity + PERIOD_S * acceleration
            at = at + PERIOD_S * velocity
        else:
            kind = generator.integers(0, 9)
            if kind == 0:
                at = far = generator.uniform(-4.0, 4.0, n)
                stay = int(generator.choice((1, 10, 300)))
            elif kind == 1:
                at = np.where(generator.random(n) < 0.5, generator.choice((math.nan, math.inf, -math.inf), n), at)
            elif kind == 2:
                at = at + generator.normal(0.0, 10.0 ** generator.uniform(-9.0, 0.0), n)
            elif kind == 3:
                at = at + PERIOD_S * generator.uniform(-4.0, 4.0, n)
            elif kind == 4:
                age_s = float(generator.choice((0.2, -0.2, math.nan, math.inf, 1e9)))
            elif kind == 5:
                step_s = float(generator.choice((0.0, -1.0, math.nan)))
            elif kind == 6:
                at = at[::-1].copy()
            elif kind == 7:
                size = int(generator.choice((0, n - 1, n + 1)))
            else:
                at = np.where(generator.random(n) < 0.5, lower, upper) + generator.normal(0.0, 1e-6, n)
