"""Errors of bags, and limits on the resources that a bag may use while it is read, against hostile bags."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from custom_ros_tools.errors import InterfaceError, shortened


@dataclass(eq=False)
class BagError(InterfaceError):
    """A bag cannot be read, or its content cannot be written as requested; the message includes a remedy."""

    path: Path
    message: str

    def __str__(self) -> str:
        return f"{self.path}: {self.message}"


class RecordingError(BagError):
    """A recording of a bag could not be started, or is not complete."""

    def __str__(self) -> str:
        return f"recording {super().__str__()}"


MAX_DEFINITION_BYTES = 2**20
"""Bytes of the definition of one message type, with those of the types it uses; a longer one is refused."""
MAX_ALL_DEFINITIONS_BYTES = 2**24
"""Bytes of all different definitions of a bag."""
MAX_DEPTH = 50
"""Levels of types within types."""
MAX_CONNECTIONS = 20_000
"""Pairs of a topic and one of its publishers."""
MAX_TOPICS = 1_000
"""Topics that have messages; each becomes a file."""
MAX_VALUES = 1_000_000
"""Largest number of values of one message; a cloud of a 640x480 camera is below it. Arrays count by element unless
stored as a whole.
"""
MAX_NAME_BYTES = 1_000
"""Bytes of the name of a column. fastparquet writes beyond its memory at 65,535."""
MAX_COLUMNS = 20_000
"""Columns of one table."""
MAX_CELLS = 200_000_000
"""Cells of all tables of a bag, 8 bytes each and twice that while tables are made; 2 h of a 7-axis arm at 1 kHz."""
BASE_TIME_S = 30.0
"""Processor time for any bag."""
TIME_PER_MB_S = 2.0
"""Processor time per MB of the compressed file; ordinary bags need less than a tenth of it."""


class LimitError(ValueError):
    """A size is above its limit; readers add the bag and the topic."""

    @classmethod
    def over(cls, limit: str, got: str) -> LimitError:
        """Returns the error for a limit with its unit, such as `1,000 bytes`, and the actual size."""
        return cls(f"expected at most {limit}, got {got}")


class Budget:
    """Budget of processor time of this thread and of table cells for one bag.

    Args:
        path: The bag, for errors.
        file_bytes: Size of its file.
        unlimited: Whether to disable the limits.
        clock: Returns the processor time [s].
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
        """Raises a BagError if the time is used up while a topic is read."""
        if not self._unlimited and self._clock() > self._end_s:
            self._refuse(topic, f"{self._time_s:.0f} s of processor time", "a bag that needs more")

    def set_cells(self, topic: str, rows: int, columns: int) -> None:
        """Counts the table of a topic, in place of its former size; raises a BagError if there are too many cells."""
        self._all_cells += rows * columns - self._cells.get(topic, 0)
        self._cells[topic] = rows * columns
        if not self._unlimited and self._all_cells > MAX_CELLS:
            self._refuse(topic, f"{MAX_CELLS:,} cells in all tables", f"{rows:,} rows of {columns:,} columns here")

    def _refuse(self, topic: str, limit: str, got: str) -> None:
        raise BagError(
            self._path, f"{shortened(topic)}: {LimitError.over(limit, got)}; --any-size, if you know who made it"
        )
