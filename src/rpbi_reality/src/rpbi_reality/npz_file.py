"""Reads arrays from NPZ files of others: no code, limited size, one error that names file and array."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from custom_ros_tools.errors import ConfigError, Problem

MAX_BYTES = 2_000_000_000
"""Largest size of a file's unpacked arrays [bytes]."""


def fault(path: Path, key: str, message: str) -> ConfigError:
    """Returns an error about an array of a file."""
    return ConfigError([Problem(str(path), key, message)])


def read_npz(path: Path) -> dict[str, np.ndarray]:
    """Reads all arrays of an NPZ file.

    Raises:
        ConfigError: If the file is no NPZ file, contains Python objects, or is larger than `MAX_BYTES`.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
        if size > MAX_BYTES:
            raise fault(path, "", f"expected at most {MAX_BYTES:,} bytes of arrays, got {size:,}")
        with np.load(path, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, KeyError) as error:
        raise fault(path, "", f"expected an NPZ file without Python objects: {error}") from None


def require(path: Path, arrays: Mapping[str, np.ndarray], shapes: Mapping[str, tuple[int | None, ...]]) -> None:
    """Checks that a file has arrays of certain shapes with finite numbers.

    Args:
        path: The file, for messages.
        arrays: Arrays of the file, indexed by name.
        shapes: Required arrays. None in a shape accepts any length.

    Raises:
        ConfigError: If an array is missing, has another shape, or contains a number that is not finite.
    """
    for name, shape in shapes.items():
        if name not in arrays:
            raise fault(path, name, f"missing; the file has {', '.join(sorted(arrays)) or 'no arrays'}")
        array = arrays[name]
        if array.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, array.shape)):
            wanted = " x ".join("any" if n is None else str(n) for n in shape) or "a single number"
            raise fault(path, name, f"expected shape {wanted}, got {array.shape}")
        if array.dtype.kind not in "fiu":
            raise fault(path, name, f"expected numbers, got {array.dtype}")
        if not np.isfinite(array).all():
            raise fault(path, name, "contains numbers that are not finite")


def rows_of(path: Path, offset: np.ndarray, rows: int, runs: int) -> list[slice]:
    """Returns the rows of each run.

    Args:
        path: The file, for messages.
        offset: First row of each run, and the number of rows at the end, shape (runs + 1,).
        rows: Number of rows.
        runs: Number of runs.

    Raises:
        ConfigError: If the offsets do not divide the rows into runs of at least two rows each.
    """
    if offset.shape != (runs + 1,) or runs < 1:
        raise fault(path, "offset", f"expected {runs + 1} offsets for {runs} runs, got shape {offset.shape}")
    if offset[0] != 0 or offset[-1] != rows or (np.diff(offset) < 2).any():
        raise fault(path, "offset", f"expected increasing rows from 0 to {rows}, with at least 2 for each run")
    return [slice(int(first), int(last)) for first, last in zip(offset[:-1], offset[1:])]
