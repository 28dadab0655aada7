"""Random arrangements of the objects of a world, and random views of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import count

import numpy as np
import numpy.typing as npt

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.transforms import matrix_of
from robot_model.geometry import Pose, normalized
from rpbi.bodies import Body
from rpbi.render.camera import Intrinsics, looking_at
from rpbi.world import World

from .models import ObjectModel, models_of

GAP_M = 0.005
"""Distance of objects that are about to fall."""
LIFT_M = 0.02
"""Step by which an object is lifted until it has no contact."""
REST_SPEED, REST_TURN = 0.005, 0.1
"""Speeds below which an object is at rest [m/s, rad/s]."""
LOOK_S = 0.1
"""Time between two checks of rest."""
PATIENCE_S = 10.0
"""Longest time for objects to come to rest."""
ATTEMPTS = 5
"""Largest number of arrangements until one comes to rest."""
ELEVATION_DEG = (25.0, 75.0)
"""Least and largest elevation of the camera."""
DISTANCE = (0.6, 1.2)
"""Least and largest distance of the camera, relative to that at which the area fills the image."""
CLEAR_M = 0.1
"""Least distance of the camera from the boxes around the links of robots [m]."""
MAX_VIEWS = 100
"""Largest number of random views until no robot obstructs one."""
SHIFT = 0.25
"""Largest shift of the point that the camera looks at, as a share of the area's radius."""

Array = npt.NDArray[np.float64]


class Arrangement:
    """The objects of a world that can lie anywhere: rigid, without joints, moved by physics.

    Objects fall into the area that their starts span, and the camera looks at its middle.

    Args:
        world: The world, at its start.

    Raises:
        InterfaceError: If it has no such object, or a mesh of one cannot be read.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        objects = [body for body in world.bodies.values() if _falls(body)]
        if not objects:
            raise InterfaceError(
                "there is nothing to label: expected `dynamic_objects`, or `urdfs` without joints whose base is free"
            )
        self.models: Mapping[str, ObjectModel] = models_of(objects)
        """Models of the objects, by name."""
        placed = [_placed(self.models[body.name].points, Pose(*body.base_pose())) for body in objects]
        centres = np.array([(each.min(axis=0) + each.max(axis=0)) / 2.0 for each in placed])
        largest = max(model.radius for model in self.models.values())
        low, high = centres.min(axis=0)[:2], centres.max(axis=0)[:2]
        grown = np.maximum(largest - (high - low) / 2.0, 0.0)
        self._low, self._high = low - grown, high + grown
        self._bottom = min(float(each[:, 2].min()) for each in placed)
        self._radius = float(np.linalg.norm(self._high - self._low)) / 2.0 + largest

    @property
    def middle(self) -> Array:
        """Middle of the lower side of the area [m], shape (3,)."""
        return np.array([*(self._low + self._high) / 2.0, self._bottom])

    def settle(self, random: np.random.Generator) -> None:
        """Resets the world, lets the objects fall from random poses, and simulates until they are at rest.

        Objects that leave the area by more than its radius are not waited for.

        Raises:
            InterfaceError: If they do not come to rest.
        """
        world = self._world
        looks = math.ceil(PATIENCE_S / LOOK_S)
        ticks = max(1, round(LOOK_S / world.clock.dt_s))
        for _ in range(ATTEMPTS):
            world.reset(rebuild=False)
            self._throw(random)
            quiet = 0
            for _ in range(looks):
                for _ in range(ticks):
                    world.step()
                fastest = max(self.models, key=self._motion)
                quiet = quiet + 1 if self._motion(fastest) < 1.0 else 0
                if quiet == 2:
                    return
        raise InterfaceError(
            f"'{fastest}' does not come to rest within {PATIENCE_S:g} s, in {ATTEMPTS} attempts: give it friction, "
            "`rollingFriction` if it is round"
        )

    def view(self, random: np.random.Generator, intrinsics: Intrinsics) -> Pose:
        """Returns a random pose of the optical frame of a camera, above the objects and looking at them.

        No robot is within `CLEAR_M` of the camera, or between the camera and the point that it looks at.

        Raises:
            InterfaceError: If robots obstruct each of `MAX_VIEWS` views.
        """
        for _ in range(MAX_VIEWS):
            eye, target = self._line_of_sight(random, intrinsics)
            if self._is_clear(eye, target):
                return Pose(*looking_at(eye.tolist(), target.tolist()))
        raise InterfaceError(f"robots are in the way of the camera in each of {MAX_VIEWS} views of the objects")

    def _line_of_sight(self, random: np.random.Generator, intrinsics: Intrinsics) -> tuple[Array, Array]:
        """Returns a random place of a camera, and the point that it looks at [m]."""
        sine = random.uniform(*np.sin(np.radians(ELEVATION_DEG)))  # so that all directions are equally likely
        azimuth = random.uniform(-math.pi, math.pi)
        cosine = math.sqrt(1.0 - sine**2)
        direction = np.array([cosine * math.cos(azimuth), cosine * math.sin(azimuth), sine])
        width, height = intrinsics.width_px, intrinsics.height_px
        opening = math.tan(math.radians(intrinsics.fov_deg) / 2.0) * min(1.0, width / height)
        target = self.middle + np.array([*random.uniform(-SHIFT, SHIFT, 2), 0.0]) * self._radius
        distance = random.uniform(*DISTANCE) * self._radius / opening
        return target + distance * direction, target

    def _is_clear(self, eye: Array, target: Array) -> bool:
        """Returns whether no robot is near a camera or between it and the point that it looks at."""
        pb, robots = self._world.pb, {body.body_id: body for body in self._world.bodies.values() if body.joint_indices}
        for body_id, body in robots.items():
            for link in (-1, *body.joint_indices):
                lower, upper = pb.getAABB(body_id, link)
                if np.linalg.norm(eye - np.clip(eye, lower, upper)) < CLEAR_M:
                    return False
        ((hit, *_),) = pb.rayTest(eye.tolist(), target.tolist()) if robots else ((-1,),)
        return hit not in robots

    def _throw(self, random: np.random.Generator) -> None:
        """Puts the objects at random places of the area, each as low as possible without contact."""
        names = [str(name) for name in random.permutation(list(self.models))]
        there = [body for body in self._world.bodies.values() if body.name not in self.models]
        for name in names:
            body, model = self._world.bodies[name], self.models[name]
            quat = normalized(random.normal(size=4).tolist())
            turned = model.points @ matrix_of((0.0, 0.0, 0.0), quat)[:3, :3].T
            low, high = turned.min(axis=0), turned.max(axis=0)
            middle = (low + high) / 2.0
            x, y = random.uniform(self._low, self._high)
            for lifts in count():
                z = self._bottom - low[2] + GAP_M + lifts * LIFT_M
                pose = Pose((x - middle[0], y - middle[1], z), quat)
                self._world.act(name, "teleport", pose)
                if not any(self._touch(body, other) for other in there):
                    break
            there.append(body)

    def _touch(self, body: Body, other: Body) -> bool:
        return bool(self._world.pb.getClosestPoints(body.body_id, other.body_id, GAP_M))

    def _motion(self, name: str) -> float:
        """Returns the motion of an object; 1 is the largest at rest."""
        body = self._world.bodies[name]
        if np.linalg.norm(np.subtract(body.base_pose().position, self.middle)) > 2.0 * self._radius:
            return 0.0
        twist = body.base_twist()
        return max(math.hypot(*twist.linear) / REST_SPEED, math.hypot(*twist.angular) / REST_TURN)


def _falls(body: Body) -> bool:
    """Returns whether a body is rigid, has no joints, and is moved by physics."""
    return not body.is_soft and body.has_physics and not body.joint_indices and body.dynamics_info(-1)[0] > 0.0


def _placed(points: Array, pose: Pose) -> Array:
    T = matrix_of(*pose)
    placed: Array = points @ T[:3, :3].T + T[:3, 3]
    return placed
