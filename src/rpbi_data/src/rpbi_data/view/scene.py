"""Content of a page, free of the libraries that draw it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from robot_model.geometry import Pose, Vector
from rpbi.bodies.visual_shapes import BodyShape

Array = NDArray[Any]

MAX_HZ = 25.0
"""Largest rate of poses and arrows on a page [Hz]."""
MAX_POSES = MAX_ARROWS = 25_000
"""Number of poses of all links of a page, and of its arrows; a longer recording has fewer a second."""


class Poses(NamedTuple):
    """Poses of a frame in the world over time.

    Attributes:
        position: Shape (n, 3) [m].
        rotation: n rotations.
    """

    position: Array
    rotation: Rotation

    @classmethod
    def still(cls, pose: Pose, count: int) -> Poses:
        """Returns one pose many times."""
        return cls(np.tile(pose.position, (count, 1)), Rotation.from_quat(np.tile(pose.quat_xyzw, (count, 1))))

    @classmethod
    def from_numbers(cls, numbers: Array) -> Poses:
        """Returns poses of rows of position and quaternion x, y, z, w, shape (n, 7)."""
        return cls(numbers[:, :3], Rotation.from_quat(numbers[:, 3:]))

    def __matmul__(self, other: Poses) -> Poses:
        """Chains poses, time by time."""
        return Poses(self.position + self.rotation.apply(other.position), self.rotation * other.rotation)


class TriangleMesh(NamedTuple):
    """A surface of triangles.

    Attributes:
        corners: Shape (n, 3) [m].
        triangles: Numbers of three corners each, shape (m, 3).
    """

    corners: Array
    triangles: Array


@dataclass
class ShownLink:
    """A link with something to be seen.

    Attributes:
        body: Name of its body.
        name: Its name.
        shapes: Its visible shapes.
        poses: Its poses in the world, at the times of the scene.
        is_there: Whether its body is in the world, at these times.
    """

    body: str
    name: str
    shapes: list[BodyShape]
    poses: Poses
    is_there: Array


@dataclass
class Arrows:
    """Forces that one topic reports.

    Attributes:
        topic: The topic.
        is_contact: Whether they are contact forces, else those of a sensor.
        points: For each time of the scene where the forces act, in the world, shape (k, 3) [m].
        forces: For each time the forces in the axes of the world, shape (k, 3) [N].
    """

    topic: str
    is_contact: bool
    points: list[Array]
    forces: list[Array]


@dataclass
class PageScene:
    """Content of a page.

    Attributes:
        title: Its title.
        start_s: Time of its start, in ROS time [s].
        times: Times of poses and arrows since the start, shape (n,) [s].
        camera: Position of the camera at the start, and the point that it looks at [m].
        links: The links.
        meshes: Meshes by the shape that they belong to.
        arrows: The forces.
        panels: Lines over time since the start [s], by the title of their panel.
        notes: Sentences on what is not shown, or otherwise than it was; see `all_notes`.
    """

    title: str
    start_s: float
    times: Array
    camera: tuple[Vector, Vector]
    links: list[ShownLink] = field(default_factory=list)
    meshes: dict[BodyShape, TriangleMesh] = field(default_factory=dict)
    arrows: list[Arrows] = field(default_factory=list)
    panels: dict[str, Mapping[str, pd.Series]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    @property
    def all_notes(self) -> list[str]:
        """The notes, and one on the rate of poses if it is lower than usual."""
        hz = (len(self.times) - 1) / self.times[-1]
        if hz >= MAX_HZ - 1.0:
            return self.notes
        reason = "since the recording is long or has many forces"
        return [*self.notes, f"the view has {hz:.3g} poses a second, {reason}; the plots have all"]

    def coarser(self, count: int) -> PageScene:
        """Returns the same with fewer times.

        Args:
            count: Their number, at least 2; the first and the last one stay.
        """
        kept = np.linspace(0, len(self.times) - 1, count).round().astype(int)
        links = [
            replace(each, poses=Poses(*(column[kept] for column in each.poses)), is_there=each.is_there[kept])
            for each in self.links
        ]
        arrows = [
            replace(each, points=[each.points[i] for i in kept], forces=[each.forces[i] for i in kept])
            for each in self.arrows
        ]
        return replace(self, times=self.times[kept], links=links, arrows=arrows)

    def with_few_arrows(self) -> PageScene:
        """Returns the same with about MAX_ARROWS arrows at most, by fewer times if there are more."""
        arrows = sum(len(points) for each in self.arrows for points in each.points)
        if arrows <= MAX_ARROWS:
            return self
        return self.coarser(max(2, len(self.times) * MAX_ARROWS // arrows))
