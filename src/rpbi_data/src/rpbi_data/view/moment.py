"""Content of a live view at one moment, and the moments of the last seconds."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from robot_model.geometry import Pose, Vector
from rpbi.bodies.visual_shapes import BodyShape

from .scene import Array

HISTORY_S = 30.0
"""Time for which the past is kept [s]."""
MAX_HISTORY_BYTES = 200_000_000
"""Size of arrows and surfaces above which less of the past is kept [bytes]."""
MAX_PARENTS = 100
"""Maximum number of frames between a frame and the world frame."""

Rgba = tuple[float, float, float, float]
Name = tuple[str, str]
"""Group of an item, such as the body that it belongs to, and name within the group."""


class Placed(NamedTuple):
    """Pose of a frame in its parent frame."""

    parent: str
    pose: Pose


@dataclass(frozen=True, eq=False)
class Item:
    """Something to draw. If it changes, it is replaced by another item of the same name.

    Attributes:
        frame: Frame that the item moves with.
        pose: Pose of the item in this frame.
    """

    frame: str
    pose: Pose

    @property
    def nbytes(self) -> int:
        """Size of the arrays of the item [bytes]."""
        return 0


@dataclass(frozen=True, eq=False)
class ShapeItem(Item):
    """A rigid shape, whose `pose_in_link` is the pose in the frame."""

    shape: BodyShape


@dataclass(frozen=True, eq=False)
class SurfaceItem(Item):
    """Triangles that may change, such as the surface of a soft body.

    Attributes:
        corners: Positions of the corners, three for each triangle, shape (3 n, 3) [m].
        rgba: Colour and opacity, each from 0 to 1.
    """

    corners: Array
    rgba: Rgba

    @property
    def nbytes(self) -> int:
        """Size of the corners [bytes]."""
        return int(self.corners.nbytes)


@dataclass(frozen=True, eq=False)
class LinesItem(Item):
    """Straight lines or arrows.

    Attributes:
        points: Start and end of each line, shape (n, 2, 3) [m].
        rgba: Colour and opacity, each from 0 to 1.
        width_m: Width of a line, or diameter of the shaft of an arrow [m].
        are_arrows: Whether the lines have heads.
    """

    points: Array
    rgba: Rgba
    width_m: float
    are_arrows: bool

    @property
    def nbytes(self) -> int:
        """Size of the points [bytes]."""
        return int(self.points.nbytes)


@dataclass(frozen=True, eq=False)
class TextItem(Item):
    """A text at a point."""

    text: str


@dataclass(frozen=True, eq=False)
class CameraItem(Item):
    """A camera. Its frame is the optical frame: x to the right, y down, z forward.

    Attributes:
        fov_rad: Vertical angle of view [rad].
        aspect: Width of the image by its height.
    """

    fov_rad: float
    aspect: float


@dataclass(frozen=True, eq=False)
class Moment:
    """Frames and items at one moment.

    Attributes:
        wall_s: Time of the moment on the monotonic clock [s].
        time_s: ROS time or simulated time of the moment [s].
        world: Name of the world frame.
        frames: Frames with their parents, indexed by name.
        items: Items to draw, indexed by name.
    """

    wall_s: float
    time_s: float
    world: str
    frames: Mapping[str, Placed]
    items: Mapping[Name, Item]

    def poses(self) -> dict[str, Pose]:
        """Returns the poses of all frames that are connected with the world frame, in the world frame."""
        found: dict[str, Pose] = {self.world: Pose()}
        for name in self.frames:
            chain: list[str] = []
            while name not in found and name in self.frames and len(chain) < MAX_PARENTS:
                chain.append(name)
                name = self.frames[name].parent
            if name in found:
                pose = found[name]
                for child in reversed(chain):
                    pose = found[child] = pose @ self.frames[child].pose
        return found


@dataclass
class History:
    """The moments of the last `HISTORY_S` seconds; fewer, if they have large arrows and surfaces."""

    moments: deque[Moment] = field(default_factory=deque)
    _sizes: dict[int, tuple[Item, int]] = field(default_factory=dict)
    """Items with arrays, and the number of moments that have them, indexed by `id`."""
    _nbytes: int = 0

    def add(self, moment: Moment) -> None:
        """Appends a moment, and drops moments that are too old or need too much memory."""
        self.moments.append(moment)
        for item in moment.items.values():
            if item.nbytes:
                _, count = self._sizes.get(id(item), (item, 0))
                self._sizes[id(item)] = item, count + 1
                self._nbytes += item.nbytes * (count == 0)
        oldest_s = moment.wall_s - HISTORY_S
        while len(self.moments) > 1 and (self.moments[0].wall_s < oldest_s or self._nbytes > MAX_HISTORY_BYTES):
            self._drop(self.moments.popleft())

    def copy(self) -> tuple[Moment, ...]:
        """Returns the moments in their order."""
        return tuple(self.moments)

    def _drop(self, moment: Moment) -> None:
        for item in moment.items.values():
            if item.nbytes:
                _, count = self._sizes[id(item)]
                if count == 1:
                    del self._sizes[id(item)]
                    self._nbytes -= item.nbytes
                else:
                    self._sizes[id(item)] = item, count - 1


def moment_at(moments: tuple[Moment, ...], age_s: float) -> Moment:
    """Returns the moment that is a given time [s] before the last of several moments."""
    wanted_s = moments[-1].wall_s - age_s
    index = int(np.searchsorted([each.wall_s for each in moments], wanted_s + 1e-9, side="right"))
    return moments[max(0, index - 1)]


def is_finite(pose: Pose) -> bool:
    """Returns whether all numbers of a pose are finite and its quaternion is not zero."""
    return math.isfinite(sum(pose.position)) and 0.0 < sum(each * each for each in pose.quat_xyzw) < math.inf


def differs(one: Vector | tuple[float, ...], other: Vector | tuple[float, ...], step: float) -> bool:
    """Returns whether two vectors differ by more than `step` in a component."""
    return any(abs(a - b) > step for a, b in zip(one, other, strict=True))
