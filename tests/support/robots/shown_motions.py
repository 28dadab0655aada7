"""Demonstrations for tests of movement primitives."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from motion_primitives import Demonstration


def reach(seed: int = 0, duration_s: float = 10.0, samples: int = 1001, orientation: bool = True) -> Demonstration:
    """Returns a curved motion of a pose from rest to rest; seeds differ in goal and height."""
    change = np.random.default_rng(seed).normal(0.0, 0.03, 4)
    times = np.linspace(0.0, duration_s, samples)
    u = times / duration_s
    share = 10 * u**3 - 15 * u**4 + 6 * u**5
    bump = np.sin(np.pi * share) ** 2
    positions = np.outer(share, np.array([-0.2, 0.5, 0.1]) + change[:3])
    positions += np.outer(bump, np.array([0.1, 0.05, 0.2]) * (1.0 + change[3])) + [0.4, 0.0, 0.3]
    turns = Rotation.from_rotvec(np.outer(share, [0.5, 1.2, -0.4])) * Rotation.from_rotvec(
        np.outer(bump, [0.6, 0, 0.5])
    )
    return Demonstration.of(times, positions, turns.as_quat() if orientation else None)


def stir(period_s: float = 1.7, duration_s: float = 8.3, ahead: float = 0.0) -> Demonstration:
    """Returns a motion of a pose that repeats."""
    times = np.linspace(0.0, duration_s, 831)
    angle = 2.0 * np.pi * (times / period_s + ahead)
    x, y = 0.1 * np.sin(angle), 0.05 * np.cos(2.0 * angle)
    positions = np.stack([0.4 + x, y, 0.3 + 0.3 * x + 0.02 * np.sin(3.0 * angle)], axis=1)
    tilt = np.stack([0.5 * np.sin(angle), 0.2 * np.cos(angle), 0.0 * angle], axis=1)
    return Demonstration.of(times, positions, (Rotation.from_euler("z", 0.3) * Rotation.from_rotvec(tilt)).as_quat())


def random_pose(rng: np.random.Generator) -> np.ndarray:
    """Returns a point within a metre, with any orientation."""
    return np.concatenate([rng.uniform(-0.5, 0.5, 3), Rotation.random(random_state=rng.integers(2**31)).as_quat()])
