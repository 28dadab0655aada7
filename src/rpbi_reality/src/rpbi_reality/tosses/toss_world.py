"""Simulates tosses in a world from YAML, and compares them with measured tosses."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
import pybullet

from custom_ros_tools.errors import ConfigError, Problem
from rpbi.bodies.dynamic import DynamicObjectConfig
from rpbi.config.pybullet_models import ResetBaseVelocity
from rpbi.world import World
from rpbi.world.loading import LoadedWorld

from ..pose_errors import angle_deg, rotated
from .toss_data import Start, TossData

Simulate = Callable[[Start, int], tuple[np.ndarray, np.ndarray]]
"""Function from a start and a number of frames to positions [m], shape (frames, 3), and quaternions (frames, 4)."""


class TossErrors(NamedTuple):
    """Errors of simulated tosses, one number for each toss, shape (tosses,).

    Attributes:
        position: Mean distance over the frames, in percent of the cube's side.
        rotation: Mean angle over the frames [deg].
        final_position: Distance at the last frame, in percent of the cube's side.
        final_rotation: Angle at the last frame [deg].
    """

    position: np.ndarray
    rotation: np.ndarray
    final_position: np.ndarray
    final_rotation: np.ndarray


def toss_errors(simulate: Simulate, data: TossData, chosen: Iterable[int] | None = None) -> TossErrors:
    """Simulates tosses, and compares each with its measurement.

    Args:
        simulate: The simulator.
        data: Measured tosses.
        chosen: Indices of the tosses; None for all.
    """
    rows = []
    for index in range(len(data.tosses)) if chosen is None else chosen:
        toss = data.tosses[index]
        position, quaternion = simulate(toss.start, len(toss.position))
        distance = np.linalg.norm(position - toss.position, axis=1) / data.side * 100.0
        angle = angle_deg(quaternion, toss.quaternion)
        rows.append((distance.mean(), angle.mean(), distance[-1], angle[-1]))
    return TossErrors(*np.array(rows).T)


def advance(world: World, ticks: int) -> None:
    """Advances a world by a number of ticks."""
    while ticks > 0:
        done = world.run_idle(ticks, math.inf)
        if not done:
            world.step()
        ticks -= done or 1


class TossWorld:
    """A world with a cube that is tossed again and again.

    Args:
        loaded: Configuration of the world, with a single dynamic object.
        frame_rate: Rate [Hz] of the frames. The time step is rounded so that a frame is a whole number of ticks.

    Raises:
        ConfigError: If the world does not have exactly one dynamic object.
    """

    def __init__(self, loaded: LoadedWorld, frame_rate: float) -> None:
        cubes = [each.config for each in loaded.objects if isinstance(each.config, DynamicObjectConfig)]
        if len(cubes) != 1:
            message = f"expected one object, which is tossed, got {len(cubes)}"
            raise ConfigError([Problem(loaded.file, "dynamic_objects", message)])
        self._cube = cubes[0]
        self._ticks = max(1, round(1.0 / frame_rate / loaded.config.timeStep))
        config = loaded.config.model_copy(update={"timeStep": 1.0 / frame_rate / self._ticks})
        self.world = World(LoadedWorld(config, loaded.objects, loaded.file), connection_mode=pybullet.DIRECT)

    def __call__(self, start: Start, frames: int) -> tuple[np.ndarray, np.ndarray]:
        """Simulates a toss, see `Simulate`."""
        self.world.reset()
        self.world.remove(self._cube.name)
        spin = rotated(start.quaternion, start.angular_velocity)
        arm = rotated(start.quaternion, np.array(self._cube.baseInertialFramePosition))
        velocity = start.linear_velocity + np.cross(spin, arm)  # PyBullet's velocity is that of the centre of mass
        moving = {
            "basePosition": tuple(start.position.tolist()),
            "baseOrientation": tuple(start.quaternion.tolist()),
            "resetBaseVelocity": ResetBaseVelocity(
                linearVelocity=tuple(velocity.tolist()), angularVelocity=tuple(spin.tolist())
            ),
        }
        body = self.world.add("dynamic", self._cube.model_copy(update=moving))
        rows = np.empty((frames, 7))
        for frame in range(frames):
            pose = body.base_pose()
            rows[frame] = (*pose.position, *pose.quat_xyzw)
            if frame < frames - 1:
                advance(self.world, self._ticks)
        return rows[:, :3], rows[:, 3:]

    def close(self) -> None:
        """Disconnects from PyBullet."""
        self.world.close()
