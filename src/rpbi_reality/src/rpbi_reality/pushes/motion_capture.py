"""Reads the recordings of the motion capture of the pushes, and the runs of the study's simulators."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from ..npz_file import fault
from ..pose_errors import unit_quaternions

MAX_BYTES = 50_000_000
BODIES = {"base": 2, "hand": 19, "cube": 36}
"""First column of each body: x, y, z [mm], three angles, residual, and the rotation matrix by columns."""
COLUMNS = 53
SIMULATED_COLUMNS = 14
"""Columns of a simulated run: position and quaternion of hand and cube."""


class MarkerPoses(NamedTuple):
    """Poses of a marker body in the frame of the motion capture: positions [m], shape (n, 3), and n orientations."""

    position: np.ndarray
    rotation: Rotation

    def rows(self, chosen: slice | np.ndarray) -> MarkerPoses:
        """Returns some of the poses."""
        return MarkerPoses(self.position[chosen], self.rotation[chosen])


class CapturedRun(NamedTuple):
    """A recording: times [s], shape (n,), and the bodies; frames in which a body was lost are left out."""

    time: np.ndarray
    base: MarkerPoses
    hand: MarkerPoses
    cube: MarkerPoses


def _numbers(path: Path, separator: str, columns: int) -> np.ndarray:
    """Reads a table of numbers without a head, shape (n, columns); short rows are filled with NaN.

    Raises:
        ConfigError: If the file is too large, or not such a table.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise ValueError(f"expected at most {MAX_BYTES:,} bytes")
        names = list(range(columns))
        table = pd.read_csv(path, sep=separator, header=None, names=names, index_col=False, dtype=float)
        return table.to_numpy()
    except (OSError, ValueError, UnicodeDecodeError) as error:
        raise fault(path, "", f"expected a table of {columns} columns of numbers: {error}") from None


def read_recording(path: Path) -> CapturedRun:
    """Reads a file `*_6D.tsv`.

    Raises:
        ConfigError: If the file is not of this form, times do not increase, or bodies are lost most of the time.
    """
    table = _numbers(path, "\t", COLUMNS)
    valid, bodies = np.isfinite(table[:, 1]), {}
    for name, first in BODIES.items():
        matrices = table[:, first + 7 : first + 16].reshape(-1, 3, 3).transpose(0, 2, 1)
        known = np.isfinite(table[:, first : first + 3]).all(1) & np.isfinite(matrices).all((1, 2))
        error = matrices @ matrices.transpose(0, 2, 1) - np.eye(3)
        valid &= known & (abs(np.nan_to_num(error, nan=1.0)).max((1, 2)) < 0.01) & (np.linalg.det(matrices) > 0.0)
        bodies[name] = table[:, first : first + 3] / 1e3, matrices
    if valid.sum() < max(2, len(table) / 2):
        raise fault(path, "", f"expected poses of base, hand and cube; {valid.sum()} of {len(table)} rows have them")
    time = table[valid, 1]
    if (np.diff(time) <= 0.0).any():
        raise fault(path, "time", "expected increasing times in the second column")
    return CapturedRun(time, *(MarkerPoses(p[valid], Rotation.from_matrix(m[valid])) for p, m in bodies.values()))


def read_simulated(path: Path) -> np.ndarray | None:
    """Reads a run of one of the study's simulators, shape (n, 14); None if it has rows of zeros.

    Raises:
        ConfigError: If the file is not of the expected form.
    """
    table = _numbers(path, r"\s+", SIMULATED_COLUMNS)
    if len(table) < 2:
        raise fault(path, "", f"expected at least two rows, got {len(table)}")
    if not table.any(1).all():
        return None
    with np.errstate(all="ignore"):  # one of the engines diverges
        table[:, 3:7], table[:, 10:] = unit_quaternions(table[:, 3:7]), unit_quaternions(table[:, 10:])
    return table
