"""Effect of commands on a world."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any

from custom_ros_tools.errors import InterfaceError

from .command_log import RecordedCommand
from .values import from_text, trusting

KEYFRAME = "keyframe"
"""Kind of a command that has the text of a keyframe."""
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
"""Commands to a world other than actions on its bodies."""


def apply_command(world: Any, command: RecordedCommand, trust: Collection[str] | None = ()) -> None:
    """Applies a recorded command to a `World`.

    Args:
        world: The world.
        command: The command.
        trust: Packages that it may import, see `trusting`.

    Raises:
        InterfaceError: If the world refuses.
        ValueError: If the command cannot be read, or is unknown.
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
    """Applies a command, with the fields of a WorldCommand, to a `World`."""
    if what in _CHANGES:
        _CHANGES[what](world, name, value)
    else:
        world.act(name, what, value)
