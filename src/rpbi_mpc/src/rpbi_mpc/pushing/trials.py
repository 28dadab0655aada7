"""Simulated trials of pushing with random friction, random centre of mass, measurement noise, delay, and shoves."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from rpbi.world import World
from rpbi.world.loading import load_world
from rpbi_mpc.controller import MpcController
from rpbi_mpc.loop import Cycle, LockStep, LoopConfig

from .config import PushingConfig
from .controller import PushingController
from .planar.paths import PushPath
from .simulated import PushingWorld

WORLD = "{rpbi_mpc}/configs/bench/config.yaml"
FRICTION, CENTRE = 0.3, 0.1
"""Largest relative error of the friction coefficients, and largest offset of the centre of mass divided by the box's
size.
"""
SIZE, HEIGHT = (0.1, 0.1), 0.025
"""Length and width of the box, and height of the box's middle [m]."""
TABLE_FRICTION, PUSHER_FRICTION = 1.0, 0.857
"""Nominal friction coefficients of table and pusher. Both are multiplied by the box's coefficient, 0.35."""
SHOVE_M, SHOVE_RAD = 0.03, math.radians(30.0)
"""Distance [m] and angle [rad] by which a shove moves the box."""
LEAST_CLEARANCE = 0.0005
"""Least distance of a shoved box from the pusher [m]."""


class Variation(NamedTuple):
    """Differences between a world and the controller's model.

    Attributes:
        seed: Seed of the tracker's noise.
        table: Factor for the friction between box and table.
        pusher: Factor for the friction between box and pusher.
        centre: Position x, y of the centre of mass, relative to the box's middle [m].
        start: Initial pose of the box, relative to the start of the path [m, m, rad].
        noise_m: Standard deviation of measured positions [m]. The standard deviation of yaw is `noise_m` times 5 rad/m.
        latency_s: Delay of measurements [s].
        size: Factor for length and width of the box.
    """

    seed: int = 1
    table: float = 1.0
    pusher: float = 1.0
    centre: tuple[float, float] = (0.0, 0.0)
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    noise_m: float = 0.0
    latency_s: float = 0.0
    size: float = 1.0

    @classmethod
    def random(cls, seed: int, noise_m: float = 0.002, latency_s: float = 0.02) -> Variation:
        """Draws a random variation. All distributions are uniform.

        Friction and centre of mass vary within `FRICTION` and `CENTRE`. The box starts at most 1 cm beside the path,
        turned by at most 0.1 rad.
        """
        random = np.random.default_rng(seed)
        table, pusher = 1.0 + random.uniform(-FRICTION, FRICTION, 2)
        x, y = random.uniform(-CENTRE, CENTRE, 2) * SIZE
        _, across, turned = random.uniform(-1.0, 1.0, 3) * (0.0, 0.01, 0.1)
        centre, start = (float(x), float(y)), (0.0, float(across), float(turned))
        return cls(seed, float(table), float(pusher), centre, start, noise_m, latency_s)


class PushingTrial(NamedTuple):
    """Result of a trial.

    Attributes:
        errors: Distance of the slider's middle from the reference in each cycle [m]. The reference waits while the
            pusher is not at the slider, and while the slider is too far behind.
        off_path: Distance of the slider's middle from the nearest point of the path in each cycle [m].
        cycles: Records of all cycles.
        truth: True scenes; see `PushingWorld.truth`.
        finished: Whether the slider reached the end of the path, with errors within the configured tolerance.
        recovered_s: Time from the shove until the error stays below the limit [s]. NaN without a shove, and inf if the
            error stays above the limit.
    """

    errors: np.ndarray
    off_path: np.ndarray
    cycles: list[Cycle]
    truth: np.ndarray
    finished: bool
    recovered_s: float = math.nan


def pushing_world(variation: Variation, path: PushPath) -> World:
    """Builds the world of a variation, with the box near the start of a path and the pusher behind the box."""
    x, y, yaw = path.poses(0.0)[0]
    cos, sin = math.cos(yaw), math.sin(yaw)
    dx, dy, turned = variation.start
    middle = np.array([x + cos * dx - sin * dy, y + sin * dx + cos * dy])
    yaw += turned
    axes = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    box = middle + axes @ variation.centre
    pusher = middle + axes @ (-variation.size * SIZE[0] / 2 - 0.011, 0.0)
    return World(load_world(WORLD, overrides=_overrides(variation, box, yaw, pusher)))


def _overrides(variation: Variation, box: np.ndarray, yaw: float, pusher: np.ndarray) -> dict[str, Any]:
    folder = WORLD.rpartition("/")[0]
    sensor = {
        "type": "vicon",
        "name": "box",
        "hz": 100,
        "latency_s": variation.latency_s,
        "noise_m": variation.noise_m,
        "noise_rad": 5.0 * variation.noise_m,
        "seed": variation.seed,
    }
    half = [*(0.5 * variation.size * np.array(SIZE)).tolist(), HEIGHT]
    offset = [-variation.centre[0], -variation.centre[1], 0.0]
    return {
        "collision_objects": [
            {"file": f"{folder}/table.yaml", "changeDynamics": {"lateralFriction": TABLE_FRICTION * variation.table}}
        ],
        "dynamic_objects": [
            {
                "file": f"{folder}/box.yaml",
                "basePosition": [float(box[0]), float(box[1]), HEIGHT],
                "baseOrientation": [0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)],
                "createCollisionShape": {"halfExtents": half, "collisionFramePosition": offset},
                "createVisualShape": {"halfExtents": half, "visualFramePosition": offset},
                "sensors": [sensor],
            }
        ],
        "robots": [
            {
                "file": f"{folder}/pusher.yaml",
                "loadURDF": {"basePosition": [float(pusher[0]), float(pusher[1]), 0.02]},
            }
        ],
    }


def run_trial(
    config: PushingConfig,
    variation: Variation,
    loop: LoopConfig | None = None,
    shove_at_s: float | None = None,
    make_controller: Callable[[PushingWorld], MpcController] | None = None,
    recovered_below: float = 0.01,
    max_s: float = 60.0,
) -> PushingTrial:
    """Runs a simulated trial: pushes the box along the configured path, and returns the result.

    Args:
        config: Configuration of the controller.
        variation: Differences between the world and the controller's model.
        loop: Timing of the loop. Default: `LoopConfig()`.
        shove_at_s: World time at which the box is shoved by 3 cm and 30 degrees [s]. Default: without a shove.
        make_controller: Makes a controller for the plant. Default: makes a `PushingController`.
        recovered_below: Error below which the box counts as recovered from the shove [m].
        max_s: Time after which the trial ends [s].
    """
    path = PushPath(config.path)
    world = pushing_world(variation, path)
    try:
        world.change_dynamics("pusher/tip", {"lateralFriction": PUSHER_FRICTION * variation.pusher})
        plant = PushingWorld(world, middle=(-variation.centre[0], -variation.centre[1]))
        plant.advance(max(variation.latency_s, 0.0) + 0.04)
        controller = PushingController(config) if make_controller is None else make_controller(plant)
        lock_step = LockStep(plant, controller, loop)
        errors: list[float] = []
        off_path: list[float] = []
        shoved: int | None = None
        while not lock_step.is_over and len(lock_step.cycles) * lock_step.config.period_s < max_s:
            if shove_at_s is not None and shoved is None and world.clock.time_s >= shove_at_s:
                shove(plant, config, np.random.default_rng((variation.seed, 1)))
                shoved = len(errors)
            lock_step.cycle()
            pose, time_s = plant.slider_pose(), getattr(controller, "path_time_s", 0.0)
            errors.append(float(np.hypot(*(pose[:2] - path.poses(time_s)[0, :2]))))
            off_path.append(path.distance(pose[:2]))
        recovered_s = math.nan if shoved is None else _recovered(errors[shoved:], recovered_below, lock_step.config)
        return PushingTrial(
            np.array(errors),
            np.array(off_path),
            lock_step.cycles,
            np.array(plant.truth),
            controller.is_finished,
            recovered_s,
        )
    finally:
        world.close()


def shove(plant: PushingWorld, config: PushingConfig, random: np.random.Generator) -> None:
    """Teleports the box by 3 cm in a random direction, and turns the box by 30 degrees to a random side.

    A box that would penetrate the pusher is placed next to the pusher instead.
    """
    world, pose = plant.world, plant.slider_pose()
    direction, side = random.uniform(-math.pi, math.pi), random.choice((-1.0, 1.0))
    yaw = pose[2] + side * SHOVE_RAD
    axes = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    middle = pose[:2] + SHOVE_M * np.array([math.cos(direction), math.sin(direction)])
    inside = np.abs(axes.T @ (plant.pusher_position() - middle)) - np.array(SIZE) / 2 - config.radius - LEAST_CLEARANCE
    if (inside < 0.0).all():
        local = axes.T @ (plant.pusher_position() - middle)
        axis = int(np.argmax(inside))
        middle = middle + axes[:, axis] * np.copysign(inside[axis], -local[axis])
    body = middle - axes @ plant.middle
    world.act(
        "box",
        "teleport",
        {
            "position": [float(body[0]), float(body[1]), HEIGHT],
            "quat_xyzw": [0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)],
        },
    )


def _recovered(errors: list[float], limit: float, loop: LoopConfig) -> float:
    """Returns the time from the first entry of `errors` until all later errors are below a limit [s].

    Returns inf if the last error is above the limit.

    Args:
        errors: Error in each cycle [m].
        limit: The limit [m].
        loop: Timing of the loop.
    """
    above = np.flatnonzero(np.array(errors) > limit)
    if len(above) == 0:
        return 0.0
    return math.inf if above[-1] == len(errors) - 1 else float((above[-1] + 1) * loop.period_s)
