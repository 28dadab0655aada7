"""Warnings of probable mistakes in a world that can be built."""

from custom_ros_tools.errors import Problem
from rpbi.world import World

from .places import place_warnings
from .values import value_warnings


def world_warnings(world: World) -> list[Problem]:
    """Returns probable mistakes in a world that has made no step yet."""
    return [*place_warnings(world), *value_warnings(world)]
