"""Logs the commands that changed a world after its start, and applies recorded commands again."""

from __future__ import annotations

import json
import zlib
from collections import deque
from collections.abc import Callable, Collection, Iterator
from itertools import islice
from typing import Any, NamedTuple

from custom_ros_tools.errors import InterfaceError

from .values import from_text, to_text, trusting

MAX_KEPT = 5_000
"""Number of commands that are kept as they are, in a few megabytes at most; older commands are compressed as text."""
MAX_PACKED_BYTES = 1 << 28
"""Largest size of the compressed commands [bytes], enough for millions of commands."""
KEYFRAME = "keyframe"
"""Kind of the command that made a keyframe; its value is the text of the keyframe."""


class WorldCommand(NamedTuple):
    """A change of a world that was requested from outside.

    Attributes:
        tick: Tick of the world at which the command was applied: after the physics of this tick, before the next step.
        name: Name of the body or camera that the command concerns; empty for the whole world. If `what` is `dynamics`,
            the name may be `NAME/LINK`. If `what` is `input`, the name is `NAME/INPUT`. If `what` is `attach` or
            `detach`, the name is the attachment's name.
        what: Kind of the command: `input`, `add`, `add_camera`, `remove`, `dynamics`, `physics`, `sensor_rate`,
            `attach`, `detach`, `halt`, `pause`, `keyframe`, or a key of ACTIONS.
        value: Value of the command, whose type depends on the kind.
    """

    tick: int
    name: str
    what: str
    value: Any


class RecordedCommand(NamedTuple):
    """Record of a command: the fields of a `WorldCommand`, with the text `data` in place of the value."""

    tick: int
    name: str
    what: str
    data: str

    @classmethod
    def of(cls, command: WorldCommand) -> RecordedCommand:
        """Returns the record of a command.

        Raises:
            TypeError: If the value of the command cannot be written as text.
        """
        return cls(command.tick, command.name, command.what, to_text(command.value))


class CommandLog:
    """The commands since a world was built or reset.

    Attributes:
        count: Number of commands since the world was built or reset, including commands that `forget` dropped.
        first: Index of the first command that `records` yields; 0 unless `forget` dropped earlier commands.
    """

    def __init__(self) -> None:
        self.clear()

    def note(self, command: WorldCommand) -> None:
        """Appends a command; if `MAX_KEPT` commands are kept already, the oldest of them is compressed."""
        if len(self._kept) == MAX_KEPT:
            self._pack(self._kept.popleft())
        self._kept.append(command)
        self.count += 1

    def since(self, index: int, most: int = MAX_KEPT) -> tuple[int, tuple[WorldCommand, ...]]:
        """Returns commands that are not compressed yet.

        Args:
            index: Index of the first command to return, counted since the world was built or reset. If this command is
                compressed already, the result begins with the oldest command that is not compressed.
            most: Maximum number of commands to return.

        Returns:
            The index of the first returned command, and the commands.
        """
        first = max(index, self.count - len(self._kept))
        end = min(first + most, self.count)
        return first, tuple(self._kept[each - self.count] for each in range(first, end))

    def records(self, first: int = 0) -> Iterator[RecordedCommand]:
        """Yields the records of all commands from an index on, except commands that `forget` dropped.

        Args:
            first: Index of the first command, counted since the world was built or reset.

        Raises:
            InterfaceError: If a command cannot be recorded, or if there were so many commands that the oldest were
                lost.
        """
        if self._fault:
            raise InterfaceError(self._fault)
        first, packed = max(first, self.first), self.count - len(self._kept)
        if first < packed:
            text = zlib.decompress(bytes(self._packed) + self._packing.copy().flush()).decode()
            lines = islice(text.splitlines(), first - self._packed_from, None)
            yield from (RecordedCommand(*json.loads(line)) for line in lines)
        try:
            yield from map(RecordedCommand.of, islice(self._kept, max(first - packed, 0), None))
        except TypeError as error:
            raise InterfaceError(f"a command cannot be recorded: {error}") from None

    def clear(self) -> None:
        """Removes all commands."""
        self._kept: deque[WorldCommand] = deque()
        self.count = 0
        self.forget()

    def forget(self) -> None:
        """Drops the records of all commands so far, because a new keyframe replaces them.

        The newest commands, which are not compressed yet, can still be read with the method `since`.
        """
        self._packing, self._packed = zlib.compressobj(), bytearray()
        self._fault = ""
        self.first, self._packed_from = self.count, self.count - len(self._kept)

    def _pack(self, command: WorldCommand) -> None:
        if self._fault:
            return
        try:
            line = json.dumps(RecordedCommand.of(command))
        except TypeError as error:
            self._fault = f"command '{command.what}' of '{command.name}' cannot be recorded: {error}"
            return
        self._packed += self._packing.compress(line.encode() + b"\n")
        if len(self._packed) > MAX_PACKED_BYTES:
            self._fault = f"the first of {self.count} commands are forgotten; reset the world"
            self._packed.clear()


_CHANGES: dict[str, Callable[[Any, str, Any], Any]] = {
    "input": lambda world, slot, value: world.apply_input(slot, value),
    "add": lambda world, _, arguments: world.add(*arguments),
    "add_camera": lambda world, _, config: world.add_camera(config),
    "remove": lambda world, name, _: world.remove(name),
    "dynamics": lambda world, name, change: world.change_dynamics(name, change),
    "attach": lambda world, _, config: world.attach(config),
    "detach": lambda world, name, _: world.detach(name),
    "physics": lambda world, _, change: world.change_physics(change),
    "sensor_rate": lambda world, name, rate: world.set_sensor_rate(name, *rate),
    "halt": lambda world, _, reason: world.halt(reason),
    "pause": lambda world, _, reason: world.pause(reason),
    KEYFRAME: lambda world, _, recorded: world.keyframe(recorded),
}
"""Functions that apply the commands other than actions on bodies, indexed by kind; arguments: world, name, value."""


def apply_command(world: Any, command: RecordedCommand, trust: Collection[str] | None = ()) -> None:
    """Applies a recorded command to a `World`.

    Args:
        world: World to which the command is applied.
        command: The recorded command.
        trust: Packages from which the command's value may import classes, see `trusting`.

    Raises:
        InterfaceError: If the world refuses the command, or the command's value contains a configuration that is not
            valid on this machine.
        ValueError: If the command's value cannot be read or has a class that is not trusted, or if applying the command
            fails with any other error.
    """
    name, what = command.name, command.what
    with trusting(trust):
        value = from_text(command.data)
        try:
            apply(world, name, what, value)
        except InterfaceError:
            raise
        except Exception as error:  # the value fits neither the command nor the world, in whatever way
            raise ValueError(f"'{what}' of '{name}' makes no sense in this world: {error!r}") from error


def apply(world: Any, name: str, what: str, value: Any) -> None:
    """Applies a command, given as the fields of a `WorldCommand`, to a `World`."""
    if what in _CHANGES:
        _CHANGES[what](world, name, value)
    else:
        world.act(name, what, value)
