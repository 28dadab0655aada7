"""Constraints that a robot keeps on its whole path: a direction of a link, or a position of a point of a link."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from custom_ros_tools.transforms import matrix_of
from robot_model.geometry import Vector

from .group import Group
from .yaml_words import built

Array = np.ndarray
STEP = 1e-5
"""Step of the differences that give derivatives of margins [rad or m]."""
PROJECTIONS = 25
"""Largest number of steps of one projection."""
INSIDE = 0.3
"""A projection ends when the margin is this share of the tolerance, so that short motions from there stay allowed."""


@dataclass(frozen=True)
class PathConstraint(ABC):
    """A constraint on the pose of a link.

    Attributes:
        link: Name of the link.
    """

    link: str

    @property
    @abstractmethod
    def room(self) -> float:
        """Largest possible margin."""

    @abstractmethod
    def margin(self, poses: Array) -> Array:
        """Returns margins for k poses of the link in the world, k x 4 x 4; a violation is a negative margin."""

    @abstractmethod
    def reach(self, group: Group, robot: int) -> Array:
        """Returns upper bounds on the change of the margin per rad or m of all driven joints of a robot."""


@dataclass(frozen=True)
class Upright(PathConstraint):
    """Keeps an axis of a link near a direction of the world, such as the axis of a cup near the vertical.

    Attributes:
        axis: The axis in the frame of the link.
        direction: The direction in the world.
        tolerance: Largest angle between both [rad].
    """

    axis: Vector = (0.0, 0.0, 1.0)
    direction: Vector = (0.0, 0.0, 1.0)
    tolerance: float = 0.1

    def __post_init__(self) -> None:
        _positive("tolerance", self.tolerance)
        for key in ("axis", "direction"):
            object.__setattr__(self, key, _unit(key, getattr(self, key)))

    @property
    def room(self) -> float:
        """See `PathConstraint`."""
        return self.tolerance

    def margin(self, poses: Array) -> Array:
        """See `PathConstraint`."""
        now = poses[:, :3, :3] @ np.array(self.axis)
        sine = np.linalg.norm(np.cross(now, self.direction), axis=1)
        angles: Array = self.tolerance - np.arctan2(sine, now @ np.array(self.direction))
        return angles

    def reach(self, group: Group, robot: int) -> Array:
        """See `PathConstraint`."""
        model = group.robots[robot].model
        moving = [joint.name for joint in model.chain(self.link) if joint.is_moving and joint.is_revolute]
        return np.abs(model.map_to(moving).factors).sum(axis=0)


@dataclass(frozen=True)
class OnPlane(PathConstraint):
    """Keeps a point of a link near a plane of the world.

    Attributes:
        point: The point in the frame of the link [m].
        origin: A point of the plane in the world [m].
        normal: Normal of the plane in the world.
        tolerance: Largest distance from the plane [m].
    """

    point: Vector = (0.0, 0.0, 0.0)
    origin: Vector = (0.0, 0.0, 0.0)
    normal: Vector = (0.0, 0.0, 1.0)
    tolerance: float = 0.01

    def __post_init__(self) -> None:
        _positive("tolerance", self.tolerance)
        _finite("point", self.point)
        _finite("origin", self.origin)
        object.__setattr__(self, "normal", _unit("normal", self.normal))

    @property
    def room(self) -> float:
        """See `PathConstraint`."""
        return self.tolerance

    def margin(self, poses: Array) -> Array:
        """See `PathConstraint`."""
        points = poses[:, :3] @ np.array((*self.point, 1.0))
        distances: Array = self.tolerance - np.abs((points - self.origin) @ np.array(self.normal))
        return distances

    def reach(self, group: Group, robot: int) -> Array:
        """See `PathConstraint`."""
        return group.robots[robot].model.reach(self.link, math.hypot(*self.point))


@dataclass(frozen=True)
class WithinCone(PathConstraint):
    """Keeps a point of a link within a cone of the world, such as the field of view of a camera.

    Attributes:
        apex: Tip of the cone in the world [m].
        axis: Axis of the cone in the world.
        half_angle: Angle between the axis and the side of the cone, up to pi / 2 [rad].
        point: The point in the frame of the link [m].
    """

    apex: Vector = (0.0, 0.0, 0.0)
    axis: Vector = (0.0, 0.0, 1.0)
    half_angle: float = 0.5
    point: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        _positive("half_angle", self.half_angle)
        if self.half_angle > math.pi / 2.0:
            raise ValueError(f"half_angle: expected at most pi/2, got {self.half_angle:g}")
        _finite("point", self.point)
        _finite("apex", self.apex)
        object.__setattr__(self, "axis", _unit("axis", self.axis))

    @property
    def room(self) -> float:
        """See `PathConstraint`."""
        return 0.05

    def margin(self, poses: Array) -> Array:
        """See `PathConstraint`."""
        offsets = poses[:, :3] @ np.array((*self.point, 1.0)) - self.apex
        along = offsets @ np.array(self.axis)
        across = np.linalg.norm(offsets - along[:, None] * self.axis, axis=1)
        sides: Array = along * math.sin(self.half_angle) - across * math.cos(self.half_angle)
        return sides

    def reach(self, group: Group, robot: int) -> Array:
        """See `PathConstraint`."""
        return group.robots[robot].model.reach(self.link, math.hypot(*self.point))


CONSTRAINTS: dict[str, type[PathConstraint]] = {"upright": Upright, "on_plane": OnPlane, "within_cone": WithinCone}


def constraint_from(data: Mapping[str, Any]) -> PathConstraint:
    """Makes a constraint from a mapping, such as `{type: upright, link: panda_hand, tolerance: 0.1}`.

    Raises:
        ValueError: If the type or a key is unknown, or a value is invalid; the message names the key.
    """
    found: PathConstraint = built(CONSTRAINTS, "constraint", data)
    return found


class BoundConstraint:
    """A constraint on the joints of a group; implements `Margin`.

    Args:
        constraint: The constraint.
        group: The joints that move.
        robot: Number of the robot in the group.

    Raises:
        UnknownNameError: If the robot does not have the link.
    """

    def __init__(self, constraint: PathConstraint, group: Group, robot: int = 0) -> None:
        self.constraint, self._group, self._robot = constraint, group, robot
        model = group.robots[robot].model
        self._frame, self._in_frame = model.frames.place(model.check_link(constraint.link))
        self._base = matrix_of(*group.robots[robot].base)
        self.reach = np.zeros(len(group.joint_names))
        self.reach[group.slices[robot]] = constraint.reach(group, robot)[group.columns[robot]]

    def margins(self, q: Array) -> Array:
        """See `Margin`."""
        frames = self._group.robots[self._robot].model.frames.at(self._group.full(q, self._robot))
        return self.constraint.margin(self._base @ frames[:, self._frame] @ self._in_frame)


def project(q: Array, group: Group, constraints: Sequence[BoundConstraint]) -> Array | None:
    """Moves a configuration until all constraints are kept; None if that fails.

    Each step is the smallest joint motion that, with linear margins, would bring each violated margin inside.
    """
    n = len(q)
    for _ in range(PROJECTIONS):
        rows, gains = [], []
        for bound in constraints:
            wanted = INSIDE * bound.constraint.room
            margins = bound.margins(np.concatenate((q[None], q + STEP * np.eye(n))))
            if margins[0] < min(wanted, 0.999 * bound.constraint.room):
                rows.append((margins[1:] - margins[0]) / STEP)
                gains.append(wanted - margins[0])
        if not rows:
            return q
        step = np.linalg.lstsq(np.array(rows), np.array(gains), rcond=1e-6)[0]
        largest = float(np.abs(step).max())
        if largest < 1e-9:
            return None
        q = np.clip(q + step * min(1.0, 0.3 / largest), group.lower, group.upper)
    return None


def _positive(key: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0.0):
        raise ValueError(f"{key}: expected a positive number, got {value}")


def _finite(key: str, value: Sequence[float]) -> None:
    if len(value) != 3 or not np.isfinite(value).all():
        raise ValueError(f"{key}: expected 3 finite numbers, got {tuple(value)}")


def _unit(key: str, value: Sequence[float]) -> Vector:
    _finite(key, value)
    length = math.hypot(*value)
    if length < 1e-9:
        raise ValueError(f"{key}: expected a vector that is not zero, got {tuple(value)}")
    x, y, z = (float(each) / length for each in value)
    return x, y, z
