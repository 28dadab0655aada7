"""The belt, the parts on it, and the box, as in configs/factory."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from robot_model.geometry import Pose, Vector
from rpbi_examples.scenes.scene import Scene

BELT_X_M, BELT_Z_M, BELT_HALF_M = 0.49, 0.92, 0.09
"""Middle and upper side of the belt, half of its width."""
FLOOR_Z_M, RIM_Z_M, HALF_X_M, HALF_Y_M = 0.88, 0.935, 0.0325, 0.1275
"""Floor and rim of the box, halves of the edges of a compartment."""


class Kind(NamedTuple):
    """A kind of parts.

    Attributes:
        height_m: Height [m].
        half_m: Half of the width that is grasped, which is along the part's y [m].
        turn: Angle about the vertical after which a part looks the same [rad]; 0 is any.
        x_m: Middle of its compartment [m].
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
"""Kinds of the parts, in the order of their tag numbers, from 1."""


def on_belt(tags: Mapping[int, Pose]) -> dict[str, Pose]:
    """Returns the poses of the tags above the belt, by part."""
    seen = {part: tags[number] for number, part in enumerate(PARTS, 1) if number in tags}
    return {part: tag for part, tag in seen.items() if abs(tag.position[0] - BELT_X_M) < BELT_HALF_M}


def is_in_box(part: str, position: Vector) -> bool:
    """Returns whether a part at a position [m] is in the compartment of its kind."""
    x, y, z = position
    return abs(x - PARTS[part].x_m) < HALF_X_M and abs(y) < HALF_Y_M and FLOOR_Z_M < z < RIM_Z_M


def missing(poses: Mapping[str, Pose]) -> list[str]:
    """Returns the parts that are not in the compartment of their kind, from the positions of all parts in the world."""
    return [part for part in PARTS if not is_in_box(part, poses[part].position)]


def grasp_yaw(kind: Kind, yaw: float, wanted: float) -> float:
    """Returns the yaw of a hand that grasps a part at a yaw; of several, the nearest to a desired one [rad]."""
    return yaw + kind.turn * round((wanted - yaw) / kind.turn) if kind.turn else wanted


class Belt:
    """A belt that starts and stops with a constant acceleration, and stops at the end of its path.

    Args:
        scene: The scene that it is in.
        slot: Input of its targets.
        joint: Its joint.
        way_m: Length of its path [m].
        speed: Its speed [m/s].
        acceleration: Its acceleration, which parts follow by friction [m/s^2].

    Attributes:
        is_on: Whether it shall run.
    """

    def __init__(self, scene: Scene, slot: str, joint: str, way_m: float, speed: float, acceleration: float) -> None:
        self._scene, self._slot, self._joint = scene, slot, joint
        self._way_m, self._most, self._acceleration = way_m, speed, acceleration
        self._at_m, self._speed, self._time_s = 0.0, 0.0, scene.seen.time_s
        self.is_on = False

    @property
    def is_moving(self) -> bool:
        """Whether it moves."""
        return self._speed > 0.0

    @property
    def has_ended(self) -> bool:
        """Whether it has stopped at the end of its path, less its braking distance."""
        return not self.is_moving and self._at_m + self._braking_m(self._most) >= self._way_m

    def act(self) -> None:
        """Moves the belt by the time since the last call."""
        dt_s, self._time_s = self._scene.seen.time_s - self._time_s, self._scene.seen.time_s
        is_free = self._at_m + self._braking_m(self._most) < self._way_m
        change = self._acceleration * dt_s * (1.0 if self.is_on and is_free else -1.0)
        self._speed = min(max(self._speed + change, 0.0), self._most)
        self._at_m = min(self._at_m + self._speed * dt_s, self._way_m)
        self._scene.put(self._slot, {self._joint: self._at_m})

    def _braking_m(self, speed: float) -> float:
        """Returns the braking distance from a speed, v^2 / (2 a) [m]."""
        return speed**2 / (2.0 * self._acceleration)
