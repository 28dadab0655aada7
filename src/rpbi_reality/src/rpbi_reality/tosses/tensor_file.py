"""Reads a tensor from a file that PyTorch wrote before version 1.6, without PyTorch and without running code."""

from __future__ import annotations

import io
import pickle
import struct
from collections import OrderedDict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from custom_ros_tools.errors import ConfigError, Problem

MAX_BYTES = 50_000_000
MAGIC = 0x1950A86A20F9469CFC6C
"""First number in such a file."""
_TYPES = {"DoubleStorage": "<f8", "FloatStorage": "<f4"}


class _View(NamedTuple):
    """A tensor before its numbers are read: type, index of the first number, shape and strides."""

    kind: str
    first: int
    shape: tuple[int, ...]
    strides: tuple[int, ...]


class _TensorReader(pickle.Unpickler):
    """Accepts the names of a plain tensor, and refuses all others."""

    def find_class(self, module: str, name: str) -> Any:
        if module == "collections" and name == "OrderedDict":
            return OrderedDict
        if module == "torch" and name in _TYPES:
            return name
        if module == "torch._utils" and name == "_rebuild_tensor_v2":
            return lambda kind, first, shape, strides, *_: _View(kind, first, tuple(shape), tuple(strides))
        raise pickle.UnpicklingError(f"{module}.{name} is no part of a tensor")

    def persistent_load(self, pid: Any) -> Any:
        return pid[1]


class _PlainReader(pickle.Unpickler):
    """Accepts numbers, texts and containers only."""

    def find_class(self, module: str, name: str) -> Any:
        raise pickle.UnpicklingError(f"{module}.{name} is no part of a header")


def read_tensor(path: Path) -> np.ndarray:
    """Reads the only tensor of a file.

    Raises:
        ConfigError: If the file is not of the expected form.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise ValueError(f"expected at most {MAX_BYTES:,} bytes")
        stream = io.BytesIO(path.read_bytes())
        if _PlainReader(stream).load() != MAGIC:
            raise ValueError("expected the format of PyTorch before 1.6")
        for _ in ("version", "machine"):
            _PlainReader(stream).load()
        view = _TensorReader(stream).load()
        keys = _PlainReader(stream).load()
        if not isinstance(view, _View) or len(keys) != 1:
            raise ValueError("expected a single tensor")
        (count,) = struct.unpack("<q", stream.read(8))
        kind = np.dtype(_TYPES[view.kind])
        numbers = np.frombuffer(stream.read(), kind)
        last = view.first + sum((n - 1) * step for n, step in zip(view.shape, view.strides))
        if len(numbers) != count or min(view.shape, default=0) < 1 or min(view.strides) < 0 or not 0 <= last < count:
            raise ValueError(f"expected {count} numbers, got {len(numbers)}")
        steps = [step * kind.itemsize for step in view.strides]
        return np.lib.stride_tricks.as_strided(numbers[view.first :], view.shape, steps).astype(float)
    except (OSError, ValueError, TypeError, KeyError, IndexError, AttributeError, EOFError, struct.error) as error:
        raise ConfigError([Problem(str(path), "", str(error))]) from None
    except pickle.UnpicklingError as error:
        raise ConfigError([Problem(str(path), "", f"expected a tensor: {error}")]) from None
