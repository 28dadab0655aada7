"""Simulates a tracking system with noise and delay, filters measured poses, and estimates the pose of a moving base."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from typing import Generic, TypeVar

import numpy as np

from robot_model.geometry import (
    Pose,
    Vector,
    minus,
    norm,
    plus,
    quaternion_of,
    quaternion_product,
    rotation_between,
    scaled,
)

NOISE_M, NOISE_RAD, DELAY_S = 0.002, math.radians(1.0), 0.02
"""Standard deviation of the noise in each axis of position [m] and rotation vector [rad]; delay of measurements [s]."""
MEAN_OF = 25
"""Number of measurements after which the filter's gain stays at 1 / `MEAN_OF`; before, the filter is a plain mean."""
JUMP_M, JUMP_RAD = 4.0 * NOISE_M, 4.0 * NOISE_RAD
"""Distance [m] and angle [rad] of a measurement from the filtered pose at which the filter restarts: the body moves."""
BASE_SMOOTHED_S = 0.2
"""Time constant with which measurements correct the estimate of a moving base [s]."""
ROUNDING_S = 1e-9

Key = TypeVar("Key", str, int)


def noisy(pose: Pose, random: np.random.Generator) -> Pose:
    """Adds random noise to a pose, and returns the noisy pose."""
    shift, turn = NOISE_M * random.standard_normal(3), NOISE_RAD * random.standard_normal(3)
    return _moved(pose, tuple(shift.tolist()), tuple(turn.tolist()))


class SensedPoses(Generic[Key]):
    """Measures poses with noise and delay, and averages the measurements of resting bodies.

    Args:
        random: Random generator for the noise.
    """

    def __init__(self, random: np.random.Generator) -> None:
        self._random = random
        self._on_the_way: deque[tuple[float, dict[Key, Pose]]] = deque()
        self._smoothed: dict[Key, tuple[int, Pose]] = {}

    def track(self, time_s: float, poses: Mapping[Key, Pose]) -> dict[Key, Pose]:
        """Measures the present poses, and returns the filtered poses from measurements whose delay has passed.

        Args:
            time_s: Present time [s].
            poses: True poses in the world, indexed by body name or tag number.
        """
        self._on_the_way.append((time_s, {key: noisy(poses[key], self._random) for key in sorted(poses)}))
        while len(self._on_the_way) > 1 and self._on_the_way[1][0] <= time_s - DELAY_S + ROUNDING_S:
            self._on_the_way.popleft()
        _, measured = self._on_the_way[0]
        self._smoothed = {key: self._corrected(key, pose) for key, pose in measured.items()}
        return {key: pose for key, (_, pose) in self._smoothed.items()}

    def _corrected(self, key: Key, measured: Pose) -> tuple[int, Pose]:
        """Filters a new measurement of a body, and returns the number of averaged measurements and the mean pose."""
        if key not in self._smoothed:
            return 1, measured
        count, pose = self._smoothed[key]
        off, turn = minus(measured.position, pose.position), rotation_between(pose.quat_xyzw, measured.quat_xyzw)
        if norm(off) > JUMP_M or norm(turn) > JUMP_RAD:
            return 1, measured
        count = min(count + 1, MEAN_OF)
        return count, _moved(pose, scaled(1.0 / count, off), scaled(1.0 / count, turn))


class BaseEstimate:
    """Estimates the pose of a robot's base: integrates the base's velocity, and corrects the pose with delayed noisy
    measurements.

    Args:
        base: True initial pose.
        period_s: Time between two updates [s].
        seed: Seed of the measurements' noise.
    """

    def __init__(self, base: Pose, period_s: float, seed: int) -> None:
        self._random, self._period_s = np.random.default_rng(seed), period_s
        self._pose = noisy(base, self._random)
        self._past: deque[tuple[Pose, Pose]] = deque(maxlen=round(DELAY_S / period_s) + 1)
        """Measured poses, each with the estimate of the same time."""

    def update(self, base: Pose, linear: Vector, angular: Vector) -> Pose:
        """Advances the estimate by one period, and returns the estimated pose.

        Args:
            base: True pose of the base, for the measurement.
            linear: Linear velocity of the base in the world [m/s].
            angular: Angular velocity of the base in the world [rad/s].
        """
        self._pose = _moved(self._pose, scaled(self._period_s, linear), scaled(self._period_s, angular))
        self._past.append((noisy(base, self._random), self._pose))
        (measured, then), gain = self._past[0], self._period_s / BASE_SMOOTHED_S
        shift, turn = minus(measured.position, then.position), rotation_between(then.quat_xyzw, measured.quat_xyzw)
        self._pose = _moved(self._pose, scaled(gain, shift), scaled(gain, turn))
        return self._pose


def _moved(pose: Pose, shift: Vector, turn: Vector) -> Pose:
    return Pose(plus(pose.position, shift), quaternion_product(quaternion_of(turn), pose.quat_xyzw))
