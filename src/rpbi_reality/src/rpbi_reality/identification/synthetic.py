"""Motion of a world with known parameters, as a measurement would show it: to try an identification."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from custom_ros_tools.files import atomic_file

from .candidate import CandidateWorld, WorldTemplate
from .fit_config import FitConfig
from .recordings import JointTrack, MeasuredRun, PoseTrack


def write_motion(
    path: Path,
    world: str,
    config: FitConfig,
    values: Mapping[str, float],
    inputs: Mapping[str, tuple[str, ...]],
    *,
    joints: Mapping[str, tuple[str, ...]],
    runs: int = 20,
    duration_s: float = 3.0,
    rate_hz: float = 100.0,
    noise_m: float = 0.001,
    noise_rad: float = 0.001,
    seed: int = 0,
) -> None:
    """Simulates runs with random joint targets, and writes the measured signals with noise to an NPZ file.

    Args:
        path: The file.
        world: Main file of the world.
        config: Parameters and signals.
        values: True values of the parameters.
        inputs: Joints of each input, indexed by slot.
        joints: Joints of each signal that measures joints.
        runs: Number of runs.
        duration_s: Duration of a run [s].
        rate_hz: Rate of the measurements [Hz].
        noise_m: Standard deviation of positions [m].
        noise_rad: Standard deviation of orientations and joint positions [rad].
        seed: Seed of targets and noise.
    """
    random = np.random.default_rng(seed)
    time = np.arange(0.0, duration_s, 1.0 / rate_hz)
    still = np.zeros((len(time), 3)), np.tile([0.0, 0.0, 0.0, 1.0], (len(time), 1))
    candidate = CandidateWorld(WorldTemplate(world, config), values)
    columns: dict[str, list[np.ndarray]] = {}
    try:
        for number in range(runs):
            poses = {signal: PoseTrack(time, *still) for signal in config.measured if signal not in joints}
            tracks = {
                signal: JointTrack(time, names, np.zeros((len(time), len(names)))) for signal, names in joints.items()
            }
            sent = {slot: JointTrack(time, names, _steps(time, len(names), random)) for slot, names in inputs.items()}
            signals = candidate.simulate(MeasuredRun(str(number), poses, tracks, sent), duration_s).signals
            for signal, rows in signals.items():
                if signal in poses:
                    measured = np.hstack([rows[:, :3] + random.normal(0.0, noise_m, still[0].shape), rows[:, 3:]])
                    measured[:, 3:6] += random.normal(0.0, noise_rad / 2.0, still[0].shape)
                    measured[:, 3:] /= np.linalg.norm(measured[:, 3:], axis=1, keepdims=True)
                    columns.setdefault(f"{signal}/pose", []).append(measured)
                else:
                    columns.setdefault(f"{signal}/joints", []).append(rows + random.normal(0.0, noise_rad, rows.shape))
            for slot, track in sent.items():
                columns.setdefault(f"{slot}/input", []).append(track.position)
    finally:
        candidate.close()
    arrays = {key: np.concatenate(parts) for key, parts in columns.items()}
    names_of = {f"{name}/names": np.array(names) for name, names in {**inputs, **joints}.items()}
    offset = np.arange(runs + 1) * len(time)
    with atomic_file(path) as part, part.open("wb") as stream:
        np.savez_compressed(stream, **arrays, **names_of, time=np.tile(time, runs), offset=offset)


def _steps(time: np.ndarray, count: int, random: np.random.Generator) -> np.ndarray:
    """Returns targets [rad] that jump to random values every 0.5 s and begin with 0, shape (n, count)."""
    levels = random.uniform(-1.0, 1.0, (int(time[-1] / 0.5) + 1, count))
    levels[0] = 0.0
    return levels[(time / 0.5 + 1e-9).astype(int)]
