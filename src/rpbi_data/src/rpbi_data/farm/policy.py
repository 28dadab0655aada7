"""Policies, which act in the world of an episode and end it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from custom_ros_tools.plugin_table import PluginTable
from custom_ros_tools.plugins import own_folders
from rpbi.world import World

own_folders.append(str(Path(__file__).parent))


class Policy:
    """Acts in the world of one episode, by `World.put` and `World.act` alone; a new one is made for each episode.

    A constructor of a subclass may change how the episode starts, for instance by `world.act("box", "teleport", pose)`.
    All that is random comes from `rng`. An exception ends the episode, which is then not written.

    Args:
        world: The world, as its files describe it, at tick 0.
        rng: Random numbers of the episode: by the seed of the farm and the number of the episode.
    """

    def __init__(self, world: World, rng: np.random.Generator) -> None:
        self.world, self.rng = world, rng

    def act(self) -> str | None:
        """Acts before a tick.

        Returns:
            The label with which the episode ends before that tick, such as `success`; None to continue.
        """
        raise NotImplementedError


POLICIES: PluginTable[Policy] = PluginTable("policy", "rpbi_data.farm.policy:Policy", {}, suggests=False)
"""Policies are those of users, by `module:Class`."""
