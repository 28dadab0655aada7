"""Errors of reading and writing bags, and limits that protect programs against hostile bags."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from custom_ros_tools.errors import InterfaceError, shortened


@dataclass(eq=False)
class BagError(InterfaceError):
    """A bag cannot be read, or its content cannot be written as requested."""

    path: Path
    message: str

    def __str__(self) -> str:
        return f"{self.path}: {self.message}"


class RecordingError(BagError):
    """A bag could not be recorded, or the recording is not complete."""

    def __str__(self) -> str:
        return f"recording {super().__str__()}"


MAX_DEFINITION_BYTES = 2**20
"""Largest size of the definition of a message type, including the definitions of the types in it [bytes]."""
MAX_ALL_DEFINITIONS_BYTES = 2**24
"""Largest total size of all different definitions in a bag [bytes]."""
MAX_DEPTH = 50
"""Largest depth of nested message types."""
MAX_CONNECTIONS = 20_000
"""Largest number of connections in a bag: pairs of a topic and one of the topic's publishers."""
MAX_TOPICS = 1_000
"""Largest number of topics with messages; each topic may become a file."""
MAX_VALUES = 1_000_000
"""Largest number of values in one message. Each element of an array counts, unless the array is stored as a whole.
"""
MAX_NAME_BYTES = 1_000
"""Largest size of a column's name [bytes]. At 65,535 bytes, fastparquet writes beyond its buffer."""
MAX_COLUMNS = 20_000
"""Largest number of columns of a table."""
MAX_CELLS = 200_000_000
"""Largest number of cells in all tables of a bag, enough for 2 h of a 7-axis arm at 1 kHz.

A cell needs 8 bytes, and 16 bytes while a table is made.
"""
BASE_TIME_S = 30.0
"""Processor time that is allowed for every bag [s]."""
TIME_PER_MB_S = 2.0
"""Additional processor time for each MB of the compressed file [s]; ordinary bags need less than a tenth of this."""


class LimitError(ValueError):
    """A size exceeds its limit. Readers of bags add the bag and the topic to the message."""

    @classmethod
    def over(cls, limit: str, got: str) -> LimitError:
        """Returns an error that states the limit with its unit, such as `1,000 bytes`, and the actual size."""
        return cls(f"expected at most {limit}, got {got}")


class Budget:
    """Limits the processor time of this thread, and the number of table cells, for reading one bag.

    Args:
        path: The bag, for error messages.
        file_bytes: Size of the bag's file [bytes].
        unlimited: Whether to disable the limits.
        clock: Function that returns the processor time of this thread [s].
    """

    def __init__(
        self, path: Path, file_bytes: int, unlimited: bool, clock: Callable[[], float] = time.thread_time
    ) -> None:
        self._path, self._unlimited, self._clock = path, unlimited, clock
        self._time_s = BASE_TIME_S + TIME_PER_MB_S * file_bytes / 1e6
        self._end_s = clock() + self._time_s
        self._cells: dict[str, int] = {}
        self._all_cells = 0

    def check_time(self, topic: str) -> None:
        """Raises a BagError, whose message names `topic`, if the processor time is used up."""
        if not self._unlimited and self._clock() > self._end_s:
            self._refuse(topic, f"{self._time_s:.0f} s of processor time", "a bag that needs more")

    def set_cells(self, topic: str, rows: int, columns: int) -> None:
        """Sets the size of a topic's table; raises a BagError if all tables together have too many cells."""
        self._all_cells += rows * columns - self._cells.get(topic, 0)
        self._cells[topic] = rows * columns
        if not self._unlimited and self._all_cells > MAX_CELLS:
            self._refuse(topic, f"{MAX_CELLS:,} cells in all tables", f"{rows:,} rows of {columns:,} columns here")

    def _refuse(self, topic: str, limit: str, got: str) -> None:
        raise BagError(
            self._path, f"{shortened(topic)}: {LimitError.over(limit, got)}; --any-size, if you know who made it"
        )
