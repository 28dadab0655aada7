"""A state of a world, from which the same world can be built again, in any process."""

from __future__ import annotations

import json
import zlib
from pathlib import Path
from typing import Any, NamedTuple

from custom_ros_tools.errors import ConfigError, InterfaceError, Problem, shortened
from custom_ros_tools.files import atomic_file

from .command_log import RecordedCommand
from .commands import apply_command

FORMAT = 1
"""Version of the file's layout."""
_OTHERS = ("description", "tick", "state_hash")
MAX_BYTES = 1 << 30
"""Largest size of an unpacked file [bytes]."""


class WorldState(NamedTuple):
    """A state of a world: what the world was built from, and all that entered it since.

    Attributes:
        description: Text of `describe`.
        commands: All commands since the world was built or reset, in their order.
        tick: The tick.
        state_hash: The hash at that tick, see `World.state_hash`.
    """

    description: str
    commands: tuple[RecordedCommand, ...]
    tick: int
    state_hash: str

    def write(self, path: str | Path) -> None:
        """Writes it to a file, `NAME.world` by custom.

        Raises:
            OSError: If it cannot be written; then no file of that name is left half-written.
        """
        data = {"format": FORMAT, **self._asdict()}
        with atomic_file(Path(path)) as part:
            part.write_bytes(zlib.compress(json.dumps(data).encode()))

    @classmethod
    def read(cls, path: str | Path) -> WorldState:
        """Returns the state of a file.

        Raises:
            ConfigError: If there is no such file, it is damaged, or of another version.
        """
        try:
            unpacking = zlib.decompressobj()
            text = unpacking.decompress(Path(path).read_bytes(), MAX_BYTES)
            if not unpacking.eof:
                reason = f"over {MAX_BYTES} bytes" if unpacking.unconsumed_tail else "it is truncated"
                raise ValueError(reason)
            return cls._of(json.loads(text))
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
        except (zlib.error, ValueError, RecursionError) as error:
            reason = f"expected a state that World.save wrote: {shortened(str(error))}"
        raise ConfigError([Problem(str(path), "", reason)])

    @classmethod
    def _of(cls, data: Any) -> WorldState:
        if not isinstance(data, dict) or "format" not in data:
            raise ValueError("it has no format")
        if data["format"] != FORMAT:
            raise ValueError(f"it has format {shortened(repr(data['format']))}, this version reads {FORMAT}")
        try:
            commands = tuple(RecordedCommand(*_typed(each, int, str, str, str)) for each in data["commands"])
            description, tick, state_hash = _typed([data[key] for key in _OTHERS], str, int, str)
            return cls(description, commands, tick, state_hash)
        except (KeyError, TypeError) as error:
            raise ValueError(f"its content is not as expected: {error!r}") from None

    def run(self, world: Any) -> None:
        """Brings a `World` that was just built or reset to this state.

        Raises:
            InterfaceError: If its state then has another hash, or a command is refused.
        """
        todo = iter(self.commands)
        command = next(todo, None)
        while True:
            while command is not None and command.tick <= world.clock.tick:
                apply_command(world, command)
                command = next(todo, None)
            if world.clock.tick >= self.tick:
                break
            world.step()
        if (found := world.state_hash()) != self.state_hash:
            raise InterfaceError(
                f"the state at tick {self.tick} is not the saved one: its hash was {self.state_hash}, now it is {found}"
            )


def _typed(values: Any, *kinds: type) -> list[Any]:
    if not isinstance(values, list) or len(values) != len(kinds) or not all(map(isinstance, values, kinds)):
        raise TypeError(f"expected {[kind.__name__ for kind in kinds]}")
    return values
