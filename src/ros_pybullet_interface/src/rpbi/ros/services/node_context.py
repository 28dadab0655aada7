"""What a service of the node needs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from rpbi.ros.object_lifecycle import ObjectLifecycle
from rpbi.ros.requests import Requests
from rpbi.ros.simulation import Simulation


class NodeContext(NamedTuple):
    """The node.

    Attributes:
        simulation: The loop that runs the world.
        ask: Reaches the simulation thread.
        objects: What comes and goes.
        loading: What reading an object's file needs to know of the world, see `load_object`.
    """

    simulation: Simulation
    ask: Requests
    objects: ObjectLifecycle
    loading: Mapping[str, Any]
