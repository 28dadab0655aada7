"""The conveyor belt of the world in configs/factory, the parts on the belt, and the box for the parts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from robot_model.geometry import Pose, Vector
from rpbi_examples.scenes.scene import Scene

BELT_X_M, BELT_Z_M, BELT_HALF_M = 0.49, 0.92, 0.09
"""x of the belt's middle, height of the belt's upper side, half of the belt's width [m]."""
FLOOR_Z_M, RIM_Z_M, HALF_X_M, HALF_Y_M = 0.88, 0.935, 0.0325, 0.1275
"""Heights of the box's floor and rim, half of a compartment's size along x, and along y [m]."""


class Kind(NamedTuple):
    """A kind of part on the belt.

    Attributes:
        height_m: Height of a part [m].
        half_m: Half of a part's width along the part's y axis [m]. The fingers close along this axis.
        turn: Angle of symmetry [rad]: a part looks the same after this rotation about the vertical. 0 stands for any
            angle.
        x_m: x of the middle of the compartment for this kind [m].
    """

    height_m: float
    half_m: float
    turn: float
    x_m: float


KINDS = {
    "cube": Kind(0.04, 0.02, math.pi / 2.0, 0.20),
    "cylinder": Kind(0.05, 0.022, 0.0, 0.27),
    "block": Kind(0.03, 0.0175, math.pi, 0.34),
}
PARTS = {f"{name}_{number}": kind for name, kind in KINDS.items() for number in (1, 2)}
"""Kind of each part, indexed by name. The parts are in the order of their tag numbers, which count from 1."""


def on_belt(tags: Mapping[int, Pose]) -> dict[str, Pose]:
    """Returns the poses of the tags above the belt, indexed by the name of the tagged part.

    Args:
        tags: Poses of all detected tags in the world, indexed by tag number.
    """
    seen = {part: tags[number] for number, part in enumerate(PARTS, 1) if number in tags}
    return {part: tag for part, tag in seen.items() if abs(tag.position[0] - BELT_X_M) < BELT_HALF_M}


def is_in_box(part: str, position: Vector) -> bool:
    """Returns whether a part is in the compartment of its kind, given the part's position in the world [m]."""
    x, y, z = position
    return abs(x - PARTS[part].x_m) < HALF_X_M and abs(y) < HALF_Y_M and FLOOR_Z_M < z < RIM_Z_M


def missing(poses: Mapping[str, Pose]) -> list[str]:
    """Returns the names of the parts that are not in the compartment of their kind.

    Args:
        poses: Poses of all parts in the world, indexed by name.
    """
    return [part for part in PARTS if not is_in_box(part, poses[part].position)]


def grasp_yaw(kind: Kind, yaw: float, wanted: float) -> float:
    """Returns the yaw, nearest to `wanted`, with which a hand can grasp a part [rad].

    Args:
        kind: Kind of the part.
        yaw: Yaw of the part [rad].
        wanted: Desired yaw of the hand [rad].
    """
    return yaw + kind.turn * round((wanted - yaw) / kind.turn) if kind.turn else wanted


class Belt:
    """Moves a belt, which starts and stops with a constant acceleration. The belt stops at the end of its path.

    Args:
        scene: Scene in which the belt moves.
        slot: World input for the targets of the belt's joint.
        joint: Name of the belt's joint.
        way_m: Length of the belt's path [m].
        speed: Speed of the running belt [m/s].
        acceleration: Acceleration of the belt [m/s^2]; low enough that friction moves the parts along.

    Attributes:
        is_on: Whether the belt is switched on.
    """

    def __init__(self, scene: Scene, slot: str, joint: str, way_m: float, speed: float, acceleration: float) -> None:
        self._scene, self._slot, self._joint = scene, slot, joint
        self._way_m, self._most, self._acceleration = way_m, speed, acceleration
        self._at_m, self._speed, self._time_s = 0.0, 0.0, scene.seen.time_s
        self.is_on = False

    @property
    def is_moving(self) -> bool:
        """Whether the belt moves."""
        return self._speed > 0.0

    @property
    def has_ended(self) -> bool:
        """Whether the belt has stopped near the end of its path and cannot start again."""
        return not self.is_moving and self._at_m + self._braking_m(self._most) >= self._way_m

    def act(self) -> None:
        """Advances the belt's target by the time since the last call, and sends the target."""
        dt_s, self._time_s = self._scene.seen.time_s - self._time_s, self._scene.seen.time_s
        is_free = self._at_m + self._braking_m(self._most) < self._way_m
        change = self._acceleration * dt_s * (1.0 if self.is_on and is_free else -1.0)
        self._speed = min(max(self._speed + change, 0.0), self._most)
        self._at_m = min(self._at_m + self._speed * dt_s, self._way_m)
        self._scene.put(self._slot, {self._joint: self._at_m})

    def _braking_m(self, speed: float) -> float:
        """Returns the braking distance at a speed v [m/s]: v^2 / (2 a) [m]."""
        return speed**2 / (2.0 * self._acceleration)
