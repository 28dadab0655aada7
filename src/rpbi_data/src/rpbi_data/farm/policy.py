"""Base class of policies. A policy acts in the world of an episode, and decides when the episode ends."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from custom_ros_tools.plugin_table import PluginTable
from custom_ros_tools.plugins import own_folders
from rpbi.world import World

own_folders.append(str(Path(__file__).parent))


class Policy:
    """Base class of policies, which act in the world of one episode. Each episode has a new policy object.

    A policy changes the world only through `World.put` and `World.act`. The constructor of a subclass may change the
    initial state, for instance with `world.act("box", "teleport", pose)`. All random values must come from `rng`.
    If the policy raises an exception, the episode is not written.

    Args:
        world: The world at tick 0, as its files describe it.
        rng: Random number generator, seeded with the seed of the farm and the number of the episode.
    """

    def __init__(self, world: World, rng: np.random.Generator) -> None:
        self.world, self.rng = world, rng

    def act(self) -> str | None:
        """Acts on the world. This method is called before each tick.

        Returns:
            None to continue, or a label, such as `success`, to end the episode before the tick.
        """
        raise NotImplementedError


POLICIES: PluginTable[Policy] = PluginTable("policy", "rpbi_data.farm.policy:Policy", {}, suggests=False)
"""Policies, which users provide and name as `module:Class`; none are built in."""
