"""Small files of the same form as the published data."""

from __future__ import annotations

from pathlib import Path

import numpy as np

RATE = 148.0


def toss_arrays(count: int = 2, frames: int = 30) -> dict[str, np.ndarray]:
    """Returns arrays of tosses that fall freely without rotation from 0.5 m."""
    time = np.arange(frames) / RATE
    one = np.stack([0.5 * time, 0.0 * time, 0.5 - 9.605 * time**2 / 2.0], 1)
    turn = np.array([0.0, 0.0, 0.0, 1.0])
    return {
        "position": np.concatenate([one] * count).astype(np.float32),
        "quaternion": np.tile(turn, (count * frames, 1)).astype(np.float32),
        "offset": np.arange(count + 1) * frames,
        "toss": np.arange(count) + 7,
        "start_position": np.tile(one[0], (count, 1)),
        "start_quaternion": np.tile(turn, (count, 1)),
        "start_linear_velocity": np.tile([0.5, 0.0, 0.0], (count, 1)),
        "start_angular_velocity": np.zeros((count, 3)),
        "frame_rate": np.array(RATE),
        "side": np.array(0.1048),
    }


def push_arrays(runs: int = 3, experiment: int = 1) -> dict[str, np.ndarray]:
    """Returns arrays of runs whose hand moves on a line, each 1 mm higher than the run before."""
    time = np.arange(0.0, 5.6, 0.01)
    turn = np.tile([0.0, 0.0, 0.0, 1.0], (len(time) * runs, 1))
    hand = [np.stack([0.1 * time, 0.0 * time, 0.0 * time + 0.001 * run], 1) for run in range(runs)]
    return {
        "time": np.tile(time, runs),
        "hand_position": np.concatenate(hand),
        "hand_quaternion": turn,
        "cube_position": np.zeros((len(time) * runs, 3)) + 0.5,
        "cube_quaternion": turn,
        "offset": np.arange(runs + 1) * len(time),
        "experiment": np.full(runs, experiment),
        "run": np.arange(runs) + 1,
    }


def write(path: Path, arrays: dict[str, np.ndarray]) -> Path:
    """Writes arrays to an NPZ file."""
    np.savez(path, **arrays)
    return path
