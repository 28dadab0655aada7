"""Checks a world without a ROS master, and tells what it would offer."""

import argparse
import logging
import signal
import sys

import pybullet

from custom_ros_tools.errors import InterfaceError
from rpbi.bodies import kind_of
from rpbi.config.loading import load_world
from rpbi.world import World

from .interface_table import Endpoint, endpoints


def main() -> None:
    """Runs the command; exits with 1 if the world has problems."""
    parser = argparse.ArgumentParser(prog="./rpbi check", description="Finds all problems of a world.")
    parser.add_argument("world", metavar="WORLD.yaml", help="main YAML file; {package}/path is resolved")
    path = parser.parse_args().world
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # so that it may be piped into `head`
    logging.basicConfig(format="warning: %(message)s", level=logging.WARNING)
    try:
        world = World(load_world(path), connection_mode=pybullet.DIRECT)
        listed = endpoints(world)
    except InterfaceError as error:
        problems = str(error).splitlines()
        print("\n".join(problems), file=sys.stderr)
        print(f"{path}: {len(problems)} problem{'s' if len(problems) > 1 else ''}", file=sys.stderr)
        sys.exit(1)
    except MemoryError as error:
        print(f"{path}: out of memory: {error or 'is there a limit, such as ulimit -v?'}", file=sys.stderr)
        sys.exit(1)
    _print(path, world, listed)
    world.close()


def _print(path: str, world: World, listed: list[Endpoint]) -> None:
    print(f"{path}: fine; {1.0 / world.clock.dt_s:g} ticks a second")
    for name, body in world.bodies.items():
        joints = f", {len(body.link_indices)} joints" if body.link_indices else ""
        print(f"  {kind_of(body):<12} {name}{joints}")
    for name in world.cameras:
        print(f"  {'camera':<12} {name}")
    kind_width, name_width, type_width = (max(map(len, column)) for column in list(zip(*listed))[:3])
    for kind, name, type_name, note, meaning in listed:
        print(f"  {kind:<{kind_width}}  {name:<{name_width}}  {type_name:<{type_width}}  {note or meaning}".rstrip())
