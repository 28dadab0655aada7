"""Saved states, from which a world can be restored in any process."""

from __future__ import annotations

import gzip
import hashlib
import json
import re
import zlib
from collections.abc import Collection, Iterator
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

from custom_ros_tools.config import MAX_BYTES as MAX_LINE_BYTES
from custom_ros_tools.config import read_file
from custom_ros_tools.errors import ConfigError, InterfaceError, Problem, shortened
from custom_ros_tools.files import atomic_file
from custom_ros_tools.foreign import load_foreign_json, printable

from .command_log import RecordedCommand, apply_command

FORMAT = 2
"""Version of the layout of files. A file has a header line, a line for each command, and the lines' SHA-256 hash."""
MAX_BYTES = 1 << 28
"""Largest size of a file, both compressed and uncompressed [bytes]."""
MAX_COMMANDS = 2_000_000
"""Largest number of commands in a file, for instance one target at each tick of 1 kHz for 33 minutes."""
MAX_TICKS = 20_000_000
"""Default limit of the number of ticks that are simulated to reach a state: 5.5 hours of a world at 1 kHz."""
_HASH = re.compile("[0-9a-f]{32}")
_BEGINNING = b'{"format": '


class WorldState(NamedTuple):
    """A state of a world, saved as the world's description and all commands that lead to the state.

    Attributes:
        description: Description of the world, as returned by `describe`.
        commands: All commands since the keyframe, in order. Without a keyframe, all since the world was built or reset.
        tick: Tick of the state.
        state_hash: Hash of the state, see `World.state_hash`.
        keyframe: Text of the keyframe that precedes the commands; empty without a keyframe.
        start: Tick of the keyframe; 0 without a keyframe.
    """

    description: str
    commands: tuple[RecordedCommand, ...]
    tick: int
    state_hash: str
    keyframe: str = ""
    start: int = 0

    def write(self, path: str | Path) -> None:
        """Writes the state to a file, conventionally named `NAME.world`. After an error, the file is unchanged.

        Raises:
            InterfaceError: If the state is larger than `read` allows.
            OSError: If the file cannot be written.
        """
        if len(self.commands) > MAX_COMMANDS:
            raise InterfaceError(
                f"{path}: expected at most {MAX_COMMANDS} commands since the world was built or reset, "
                f"got {len(self.commands)}"
            )
        seal, size = hashlib.sha256(), 0
        with atomic_file(Path(path)) as part, gzip.GzipFile(part, "wb", compresslevel=6, mtime=0) as file:
            for line in self._lines():
                size += file.write(line)
                seal.update(line)
                if size > MAX_BYTES:
                    raise InterfaceError(f"{path}: expected at most {MAX_BYTES} bytes, got more")
            file.write(seal.hexdigest().encode())

    def _lines(self) -> Iterator[bytes]:
        header = {"format": FORMAT, **self._asdict(), "commands": len(self.commands)}
        for value in (header, *self.commands):
            yield json.dumps(value).encode() + b"\n"

    @classmethod
    def read(cls, path: str | Path) -> WorldState:
        """Reads a state from a file.

        Raises:
            ConfigError: If the file does not exist, is too large, or was not written by a compatible `write`.
        """
        try:
            packed = read_file(path, MAX_BYTES)
        except OSError as error:
            raise ConfigError([Problem(str(path), "", (error.strerror or str(error)).lower())]) from None
        try:
            with gzip.GzipFile(fileobj=BytesIO(packed)) as file:
                return cls._of(file)
        except (OSError, EOFError, zlib.error, ValueError, TypeError, KeyError, ConfigError) as error:
            reason = "it is truncated" if isinstance(error, EOFError) else printable(str(error), 200)
        raise ConfigError([Problem(str(path), "", f"expected a state that World.save of this version wrote: {reason}")])

    @classmethod
    def _of(cls, file: gzip.GzipFile) -> WorldState:
        """Reads a state from a file that is decompressed line by line, to limit the memory used for invalid files."""
        seal = hashlib.sha256()

        def next_line() -> Any:
            line = file.readline(MAX_LINE_BYTES + 1)
            if file.tell() > MAX_BYTES:
                raise ValueError(f"it has over {MAX_BYTES} bytes")
            seal.update(line)
            return load_foreign_json(line, f"byte {file.tell() - len(line)}", MAX_LINE_BYTES)

        header = next_line()
        if not isinstance(header, dict) or header.get("format") != FORMAT:
            given = header.get("format") if isinstance(header, dict) else None
            raise ValueError(f"it has format {shortened(repr(given))}, this version reads {FORMAT}")
        kinds = {"description": str, "tick": int, "state_hash": str, "keyframe": str, "start": int, "commands": int}
        *values, count = _typed([header[key] for key in kinds], *kinds.values())
        description, tick, state_hash, keyframe, start = values
        if not 0 <= count <= MAX_COMMANDS:
            raise ValueError(f"expected 0 to {MAX_COMMANDS} commands, got {shortened(str(count))}")
        commands = tuple(RecordedCommand(*_typed(next_line(), int, str, str, str)) for _ in range(count))
        if not _HASH.fullmatch(state_hash):
            raise ValueError(f"expected a hash of 32 hexadecimal digits, got '{shortened(state_hash)}'")
        if not all(command.name.isprintable() and command.what.isprintable() for command in commands):
            raise ValueError("a command has a name with control characters")
        ticks = [0, start, *(command.tick for command in commands), tick]
        if ticks != sorted(ticks):
            raise ValueError("the ticks of its commands are not in order, or beyond its own")
        if file.read(65) != seal.hexdigest().encode():
            raise ValueError("its content is not as it was written")
        return cls(description, commands, tick, state_hash, keyframe, start)

    @classmethod
    def is_file(cls, path: str | Path) -> bool:
        """Returns whether a file begins like a file that `write` wrote."""
        with suppress(OSError, EOFError, zlib.error), gzip.open(path) as file:
            return file.read(len(_BEGINNING)) == _BEGINNING
        return False

    def require_short(self, max_ticks: int) -> None:
        """Checks the number of ticks to simulate until the state is reached: a forged file could demand days of work.

        Raises:
            InterfaceError: If the number of ticks exceeds `max_ticks`.
        """
        ticks = self.tick - self.start
        if ticks > max_ticks:
            raise InterfaceError(
                f"expected a state at most {max_ticks} ticks from the start, got one of {ticks} ticks; "
                f"max_ticks={ticks}, if you know who made it"
            )

    def run(self, world: Any, trust: Collection[str] | None = ()) -> Iterator[int]:
        """Simulates a `World`, which was just built or reset, until it reaches this state; yields each tick on the way.

        Args:
            world: The world.
            trust: Packages from which the keyframe and the commands may import classes, see `trusting`.

        Raises:
            InterfaceError: If the keyframe or a command cannot be applied, or the reached state has another hash.
        """
        if self.keyframe:
            world.enter_keyframe(self.keyframe, trust)
        if world.clock.tick != self.start:
            raise InterfaceError(f"expected a keyframe of tick {self.start}, got one of tick {world.clock.tick}")
        todo = iter(self.commands)
        command = next(todo, None)
        while True:
            try:
                while command is not None and command.tick <= world.clock.tick:
                    apply_command(world, command, trust)
                    command = next(todo, None)
                if world.clock.tick >= self.tick:
                    break
                world.step()
            except InterfaceError:
                raise
            except Exception as error:  # a command that makes no sense, at once or in the step after it
                raise InterfaceError(f"tick {world.clock.tick}: {printable(str(error) or repr(error))}") from error
            yield world.clock.tick
        if (now := world.state_hash()) != self.state_hash:
            raise InterfaceError(
                f"the state at tick {self.tick} is not the saved one: its hash was {self.state_hash}, now it is {now}"
            )


def _typed(values: Any, *kinds: type) -> list[Any]:
    if not isinstance(values, list) or len(values) != len(kinds) or not all(map(isinstance, values, kinds)):
        raise TypeError(f"expected {[kind.__name__ for kind in kinds]}")
    return values
