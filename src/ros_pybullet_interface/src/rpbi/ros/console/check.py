"""The command `check`."""

import logging
import sys
from collections.abc import Iterator
from typing import Annotated

import pybullet

from custom_ros_tools.console.argument import Argument
from custom_ros_tools.errors import InterfaceError, Problem
from custom_ros_tools.foreign import printable_lines
from rpbi.bodies import BODY_TYPES
from rpbi.images import drawing_times
from rpbi.ros.interface_table import Endpoint, endpoints
from rpbi.world import World
from rpbi.world.loading import load_world
from rpbi.world.world_warnings import world_warnings


def check(path: Annotated[str, Argument("WORLD.yaml", files="*.yaml")]) -> int:
    """Reports all problems of a world, or lists the topics and services of a valid world; needs no ROS master.

    The exit code is 1 if there are problems. The path may begin with the name of a ROS package, as `{package}/PATH`.
    """
    warnings = _Warnings()
    logging.getLogger().addHandler(warnings)
    try:
        world = World(load_world(path), connection_mode=pybullet.DIRECT)
        listed = endpoints(world)
    except InterfaceError as error:
        problems = str(error).splitlines()
        print("\n".join(f"error: {printable_lines(problem)}" for problem in problems), file=sys.stderr)
        print(f"{path}: {_counted(len(problems), 'error')}{warnings.counted()}", file=sys.stderr)
        return 1
    except MemoryError as error:
        print(f"{path}: out of memory: {error or 'is there a limit, such as ulimit -v?'}", file=sys.stderr)
        return 1
    for warning in (*world_warnings(world), *_slow_cameras(world)):
        warnings.report(str(warning))
    print(printable_lines("\n".join(_lines(path, world, listed, warnings.counted()))))
    world.close()
    return 0


def _slow_cameras(world: World) -> Iterator[Problem]:
    """Yields a warning if this machine is too slow to draw the images of all cameras at their rates."""
    times = drawing_times(world)
    rates = {camera.config.name: camera.config.hz for camera in world.loaded.cameras}
    busy = {name: time_s * rates[name] for name, time_s in times.items() if name in rates}
    if world.config.real_time_factor and sum(busy.values()) * world.config.real_time_factor > 1.0:
        slowest = max(busy, key=lambda name: busy[name])
        camera = next(camera for camera in world.loaded.cameras if camera.config.name == slowest)
        size = f"{camera.config.intrinsics.width} x {camera.config.intrinsics.height}"
        others = f", with {len(busy) - 1} more cameras" if len(busy) > 1 else ""
        able = f"this machine draws at most {1.0 / times[slowest]:.2g} images of {size} a second{others}"
        yield Problem(camera.file, "hz", f"{camera.config.hz:g} is too much for '{slowest}': {able}")


class _Warnings(logging.Handler):
    """Prints and counts warnings, including logged ones."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._count = 0

    def emit(self, record: logging.LogRecord) -> None:
        self.report(record.getMessage())

    def report(self, message: str) -> None:
        """Prints a warning."""
        self._count += 1
        print(f"warning: {printable_lines(message)}", file=sys.stderr)

    def counted(self) -> str:
        """Returns the number of warnings as text for the end of a line, such as `, 2 warnings`; empty for 0."""
        return f", {_counted(self._count, 'warning')}" if self._count else ""


def _counted(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _lines(path: str, world: World, listed: list[Endpoint], warnings: str) -> Iterator[str]:
    yield f"{path}: fine; {1.0 / world.clock.dt_s:g} ticks a second{warnings}"
    for name, body in world.bodies.items():
        joints = f", {len(body.link_indices)} joints" if body.link_indices else ""
        yield f"  {BODY_TYPES.name_of(body):<12} {name}{joints}"
    for name in world.cameras:
        yield f"  {'camera':<12} {name}"
    kind_width, name_width, type_width = (max(map(len, column)) for column in list(zip(*listed))[:3])
    for kind, name, type_name, note, meaning in listed:
        yield f"  {kind:<{kind_width}}  {name:<{name_width}}  {type_name:<{type_width}}  {note or meaning}".rstrip()
