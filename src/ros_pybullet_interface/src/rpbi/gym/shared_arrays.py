"""Arrays in memory that several processes share."""

from __future__ import annotations

import mmap
import os
from collections.abc import Iterator
from math import prod
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from custom_ros_tools.errors import InterfaceError

Array = npt.NDArray[Any]

ALIGNMENT = 64
"""Each array begins at a multiple of this [bytes]."""


def leaves(space: spaces.Space[Any], path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], spaces.Box]]:
    """Yields, for each box of an observation space, the dictionary keys that lead to the box, and the box.

    Raises:
        InterfaceError: If the space contains anything but boxes and dictionaries.
    """
    if isinstance(space, spaces.Dict):
        for key, inner in space.spaces.items():
            yield from leaves(inner, (*path, key))
    elif isinstance(space, spaces.Box):
        yield path, space
    else:
        raise InterfaceError(f"expected observations that are boxes, or dictionaries of such, got {space}")


class SharedArrays:
    """Results of n environments, in memory that processes share: observations, rewards and flags of ended episodes.

    Args:
        space: Observation space of one environment.
        count: Number n of environments.
        file: File descriptor of existing memory; `close` closes the descriptor. None: allocates new memory.

    Attributes:
        file: File descriptor of the memory.
        observations: Array of each box for all environments, shape (n, ...), indexed by the keys that lead to the box.
        rewards: Shape (n,), float64.
        terminations: Shape (n,), bool.
        truncations: Shape (n,), bool.
    """

    def __init__(self, space: spaces.Space[Any], count: int, file: int | None = None) -> None:
        boxes = dict(leaves(space))
        size = sum(_padded(count * prod(box.shape) * np.dtype(box.dtype).itemsize) for box in boxes.values())
        size += _padded(8 * count) + 2 * _padded(count)
        if file is None:
            file = os.memfd_create("environments")
            os.ftruncate(file, size)
        self.file = file
        self._memory = mmap.mmap(file, size)
        self._begin = 0
        self.observations = {path: self._array((count, *box.shape), box.dtype) for path, box in boxes.items()}
        self.rewards = self._array((count,), np.float64)
        self.terminations, self.truncations = self._array((count,), np.bool_), self._array((count,), np.bool_)

    def write(self, index: int, observation: Any) -> None:
        """Stores the observation of one environment."""
        for path, array in self.observations.items():
            value = observation
            for key in path:
                value = value[key]
            array[index] = value

    def read(self) -> Any:
        """Returns copies of the observations of all environments, with the structure of the batched space."""
        nested: dict[str, Any] = {}
        for path, array in self.observations.items():
            if not path:
                return array.copy()
            inner = nested
            for key in path[:-1]:
                inner = inner.setdefault(key, {})
            inner[path[-1]] = array.copy()
        return nested

    def close(self) -> None:
        """Closes the file descriptor. The arrays remain valid."""
        os.close(self.file)

    def _array(self, shape: tuple[int, ...], dtype: Any) -> Array:
        array: Array = np.ndarray(shape, dtype, self._memory, self._begin)
        self._begin += _padded(array.nbytes)
        return array


def _padded(size: int) -> int:
    return -(-size // ALIGNMENT) * ALIGNMENT
