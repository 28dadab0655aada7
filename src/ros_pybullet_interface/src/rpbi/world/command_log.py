"""Commands that entered a world after its start, by tick."""

from collections import deque
from typing import Any, NamedTuple

MAX_KEPT = 5_000
"""Commands that are kept, some megabytes at most."""


class WorldCommand(NamedTuple):
    """Something that entered a world.

    Attributes:
        tick: The world's tick: it entered after that tick's physics, before the next.
        name: The body that it concerns, `NAME/LINK` for dynamics, `NAME/INPUT` for inputs, an attachment's name for
            those, empty for the whole world.
        what: Its kind: `input`, `add`, `remove`, `dynamics`, `physics`, `sensor_rate`, `attach`, `detach`, `halt`,
            `pause`, or a key of ACTIONS.
        value: Its value.
    """

    tick: int
    name: str
    what: str
    value: Any


class CommandLog:
    """The newest commands since a world was built or reset, and their number.

    Attributes:
        count: Number of commands so far.
    """

    def __init__(self) -> None:
        self.clear()

    def note(self, command: WorldCommand) -> None:
        """Appends one; the oldest is forgotten if there are too many."""
        self._kept.append(command)
        self.count += 1

    def since(self, index: int, most: int = MAX_KEPT) -> tuple[int, tuple[WorldCommand, ...]]:
        """Returns the commands from an index on, as far as they are kept, and the index of the first."""
        first = max(index, self.count - len(self._kept))
        end = min(first + most, self.count)
        return first, tuple(self._kept[each - self.count] for each in range(first, end))

    def clear(self) -> None:
        """Begins afresh."""
        self._kept: deque[WorldCommand] = deque(maxlen=MAX_KEPT)
        self.count = 0
