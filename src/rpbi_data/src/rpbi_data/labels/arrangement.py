"""Random arrangements of the objects of a world, and random camera views of these arrangements."""

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
"""Minimum distance of an object from the bodies around it before the objects fall [m]."""
LIFT_M = 0.02
"""Height by which an object is lifted at a time until it does not touch another body [m]."""
REST_SPEED, REST_TURN = 0.005, 0.1
"""Linear speed [m/s] and angular speed [rad/s] below which an object is at rest."""
LOOK_S = 0.1
"""Simulated time between two checks whether the objects are at rest [s]."""
PATIENCE_S = 10.0
"""Maximum simulated time for the objects to come to rest [s]."""
ATTEMPTS = 5
"""Maximum number of arrangements that are tried until the objects come to rest."""
ELEVATION_DEG = (25.0, 75.0)
"""Minimum and maximum elevation of the camera above the horizontal [deg]."""
DISTANCE = (0.6, 1.2)
"""Minimum and maximum distance of the camera, relative to the distance at which the area fills the image."""
CLEAR_M = 0.1
"""Minimum distance of the camera from the bounding boxes of robot links [m]."""
MAX_VIEWS = 100
"""Maximum number of random views that are tried until robots do not obstruct the view."""
SHIFT = 0.25
"""Maximum shift of the point that the camera looks at along x and y, as a fraction of the area's radius."""

Array = npt.NDArray[np.float64]


class Arrangement:
    """Arranges the objects of a world. Objects are the rigid bodies without joints that are moved by physics.

    The objects fall onto a rectangular area that contains their initial positions. The camera looks at a random point
    near the middle of this area.

    Args:
        world: The world in its initial state.

    Raises:
        InterfaceError: If the world has no objects, or the visible surface of an object cannot be read.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        objects = [body for body in world.bodies.values() if _falls(body)]
        if not objects:
            raise InterfaceError(
                "there is nothing to label: expected `dynamic_objects`, or `urdfs` without joints whose base is free"
            )
        self.models: Mapping[str, ObjectModel] = models_of(objects)
        """Models of the objects, indexed by object name."""
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
        """Middle of the area, at the height of the objects' lowest initial point, shape (3,) [m]."""
        return np.array([*(self._low + self._high) / 2.0, self._bottom])

    def settle(self, random: np.random.Generator) -> None:
        """Resets the world, lets the objects fall from random poses, and simulates until they are at rest.

        An object whose distance from the area's middle exceeds twice the area's radius counts as at rest, even if the
        object moves.

        Raises:
            InterfaceError: If the objects do not come to rest in any of `ATTEMPTS` attempts.
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
        """Returns a random pose of the camera's optical frame in the world frame.

        The camera is above the area, and looks at a random point near the middle of the area. No robot is within
        `CLEAR_M` of the camera, or between the camera and this point.

        Raises:
            InterfaceError: If robots obstruct all of `MAX_VIEWS` views.
        """
        for _ in range(MAX_VIEWS):
            eye, target = self._line_of_sight(random, intrinsics)
            if self._is_clear(eye, target):
                return Pose(*looking_at(eye.tolist(), target.tolist()))
        raise InterfaceError(f"robots are in the way of the camera in each of {MAX_VIEWS} views of the objects")

    def _line_of_sight(self, random: np.random.Generator, intrinsics: Intrinsics) -> tuple[Array, Array]:
        """Returns a random position of a camera, and the point that the camera looks at, each of shape (3,) [m]."""
        sine = random.uniform(*np.sin(np.radians(ELEVATION_DEG)))  # makes all directions equally likely
        azimuth = random.uniform(-math.pi, math.pi)
        cosine = math.sqrt(1.0 - sine**2)
        direction = np.array([cosine * math.cos(azimuth), cosine * math.sin(azimuth), sine])
        width, height = intrinsics.width_px, intrinsics.height_px
        opening = math.tan(math.radians(intrinsics.fov_deg) / 2.0) * min(1.0, width / height)
        target = self.middle + np.array([*random.uniform(-SHIFT, SHIFT, 2), 0.0]) * self._radius
        distance = random.uniform(*DISTANCE) * self._radius / opening
        return target + distance * direction, target

    def _is_clear(self, eye: Array, target: Array) -> bool:
        """Returns True if no robot is near the camera position `eye`, and no robot hides `target` from `eye`."""
        pb, robots = self._world.pb, {body.body_id: body for body in self._world.bodies.values() if body.joint_indices}
        for body_id, body in robots.items():
            for link in (-1, *body.joint_indices):
                lower, upper = pb.getAABB(body_id, link)
                if np.linalg.norm(eye - np.clip(eye, lower, upper)) < CLEAR_M:
                    return False
        ((hit, *_),) = pb.rayTest(eye.tolist(), target.tolist()) if robots else ((-1,),)
        return hit not in robots

    def _throw(self, random: np.random.Generator) -> None:
        """Puts each object at a random place above the area, in a random orientation, high enough to touch nothing."""
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
        """Returns an object's speed divided by the speed below which objects count as at rest.

        Returns 0 for an object far from the area.
        """
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
