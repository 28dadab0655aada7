"""Simulates one experiment of the arm in a world from YAML."""

from __future__ import annotations

import numpy as np
import pybullet

from custom_ros_tools.errors import ConfigError, Problem
from rpbi.world import World
from rpbi.world.loading import LoadedWorld

from .push_data import PushPoses, times

HAND = "m1n6s300_link_6"
BASE = "m1n6s300_link_base"
START_S = 1.0
"""Simulated time [s] of the measurements' time 0; before, the arm comes to rest."""


def simulate_pushes(loaded: LoadedWorld, experiment: int) -> PushPoses:
    """Simulates an experiment, and returns poses at the times of comparison.

    Args:
        loaded: Configuration of the world, with the robot `arm` with a `VelocityServo`, and the object `cube`.
        experiment: Number of the experiment, 1 to 3.

    Raises:
        ConfigError: If the world lacks the arm, one of its links, or the cube.
        PhysicsError: If the simulation diverges.
    """
    world = World(loaded, connection_mode=pybullet.DIRECT)
    try:
        for name in ("arm", "cube"):
            if name not in world.bodies:
                raise ConfigError([Problem(loaded.file, "", f"expected an object '{name}'")])
        arm, cube = world.bodies["arm"], world.bodies["cube"]
        links = {arm.link_name(index): index for index in (-1, *arm.link_indices)}
        for link in (HAND, BASE):
            if link not in links:
                raise ConfigError([Problem(loaded.file, "arm", f"expected a link '{link}'")])
        rows = []
        for when in times(experiment):
            ticks = round((START_S + when) / world.clock.dt_s) - world.clock.tick
            for _ in range(ticks):
                world.step()
            base = arm.link_pose(links[BASE]).inverse()
            hand, box = base @ arm.link_pose(links[HAND]), base @ cube.base_pose()
            rows.append((*hand.position, *hand.quat_xyzw, *box.position, *box.quat_xyzw))
    finally:
        world.close()
    columns = np.array(rows)
    return PushPoses(columns[:, :3], columns[:, 3:7], columns[:, 7:10], columns[:, 10:])
