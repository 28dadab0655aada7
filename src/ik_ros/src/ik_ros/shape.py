"""Options of spheres, boxes and capsules that approximate links and obstacles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from pydantic import model_validator

from custom_ros_tools.schema import ConfigModel, KeyedError, ListOf, Position, PositiveMetres, Quat, Text
from robot_model.geometry import Pose


class RoundedCore(NamedTuple):
    """A shape as a core (a point, a line or a box) and a radius around the core.

    Attributes:
        half: Half lengths of the core along x, y and z [m].
        radius: Distance of the shape's surface from the core [m].
    """

    half: np.ndarray
    radius: float

    @property
    def is_box(self) -> bool:
        """Whether the core is a box. If False, the core is a point, or a line along z."""
        return bool(self.half[:2].any())


class ShapeConfig(ConfigModel):
    """A shape on a link, or an obstacle; exactly one of `sphere`, `box` and `capsule` is given.

    Attributes:
        name: Name of the shape in tasks and messages.
        link: Link that the shape is attached to. None: the shape is fixed in the base frame.
        position: Position of the shape's centre in the link's frame or base frame [m].
        orientation: Orientation of the shape in the link's frame or base frame, quaternion x, y, z, w.
        sphere: Radius of a sphere [m].
        box: Full lengths of a box along x, y and z [m].
        capsule: Radius of a capsule, and its length along z between the centres of the round ends [m].
    """

    name: Text
    link: Text | None = None
    position: Position = (0.0, 0.0, 0.0)
    orientation: Quat = (0.0, 0.0, 0.0, 1.0)
    sphere: PositiveMetres | None = None
    box: ListOf[PositiveMetres] | None = None
    capsule: ListOf[PositiveMetres] | None = None

    @model_validator(mode="after")
    def _is_one_shape(self) -> ShapeConfig:
        given = [kind for kind in ("sphere", "box", "capsule") if getattr(self, kind) is not None]
        if len(given) != 1:
            raise KeyedError("", f"expected one of sphere, box and capsule, got {' and '.join(given) or 'none'}")
        for kind, count in (("box", 3), ("capsule", 2)):
            values = getattr(self, kind)
            if values is not None and len(values) != count:
                raise KeyedError(kind, f"expected {count} numbers [m], got {len(values)}")
        return self

    @property
    def pose(self) -> Pose:
        """Pose of the shape in the frame of `link`, or in the base frame."""
        return Pose(self.position, self.orientation)

    @property
    def core(self) -> RoundedCore:
        """The shape as a core and a radius."""
        if self.sphere is not None:
            return RoundedCore(np.zeros(3), self.sphere)
        if self.capsule is not None:
            return RoundedCore(np.array((0.0, 0.0, self.capsule[1] / 2.0)), self.capsule[0])
        return RoundedCore(np.array(self.box) / 2.0, 0.0)
