"""Content of a page that shows a recording, independent of the libraries that draw the page."""

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
"""Maximum total number of link poses, and of arrows, on a page; long recordings are shown at lower rates."""


class Poses(NamedTuple):
    """Poses of a frame at n times.

    Attributes:
        position: Positions, shape (n, 3) [m].
        rotation: The n rotations.
    """

    position: Array
    rotation: Rotation

    @classmethod
    def still(cls, pose: Pose, count: int) -> Poses:
        """Returns poses that are equal at all `count` times."""
        return cls(np.tile(pose.position, (count, 1)), Rotation.from_quat(np.tile(pose.quat_xyzw, (count, 1))))

    @classmethod
    def from_numbers(cls, numbers: Array) -> Poses:
        """Converts an array of shape (n, 7) to poses. A row is a position [m] and a quaternion x, y, z, w."""
        return cls(numbers[:, :3], Rotation.from_quat(numbers[:, 3:]))

    def __matmul__(self, other: Poses) -> Poses:
        """Composes the poses at each time.

        If `self` has the poses of a frame A in a frame B, and `other` has poses in A, the result has these poses in B.
        """
        return Poses(self.position + self.rotation.apply(other.position), self.rotation * other.rotation)


class TriangleMesh(NamedTuple):
    """A surface of triangles.

    Attributes:
        corners: Positions of the corners, shape (n, 3) [m].
        triangles: Indices of the three corners of each triangle, shape (m, 3).
    """

    corners: Array
    triangles: Array


@dataclass
class ShownLink:
    """A link with visible shapes, and its poses over time.

    Attributes:
        body: Name of the link's body.
        name: Name of the link.
        shapes: Visible shapes of the link.
        poses: Poses of the link in the world, at the times of the scene.
        is_there: Whether the body is in the world at each time of the scene, shape (n,).
    """

    body: str
    name: str
    shapes: list[BodyShape]
    poses: Poses
    is_there: Array


@dataclass
class Arrows:
    """Forces that one topic reports over time.

    Attributes:
        topic: Name of the topic.
        is_contact: Whether the forces are contact forces. If False, they are measured by a force sensor.
        points: Points of application in the world frame, one array of shape (k, 3) [m] for each time of the scene.
        forces: Forces in the world frame, one array of shape (k, 3) [N] for each time of the scene.
    """

    topic: str
    is_contact: bool
    points: list[Array]
    forces: list[Array]


@dataclass
class PageScene:
    """Content of a page.

    Attributes:
        title: Title of the page.
        start_s: ROS time of the start of the scene [s].
        times: Times of poses and arrows since the start, shape (n,) [s].
        camera: Initial position of the camera, and the point that it looks at [m].
        links: Visible links.
        meshes: Meshes of the links, indexed by shape.
        arrows: Forces, with one entry for each topic.
        panels: Lines of the plots over time since the start [s], indexed by plot title.
        notes: Messages about content that is not shown, or differs from the recording; see `all_notes`.
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
        """The notes, and a message if the scene has fewer times per second than `MAX_HZ`."""
        hz = (len(self.times) - 1) / self.times[-1]
        if hz >= MAX_HZ - 1.0:
            return self.notes
        reason = "since the recording is long or has many forces"
        return [*self.notes, f"the view has {hz:.3g} poses a second, {reason}; the plots have all"]

    def coarser(self, count: int) -> PageScene:
        """Returns the same scene with fewer times.

        Args:
            count: Number of times, at least 2. The first and the last time are kept.
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
        """Returns this scene, with fewer times if it has more than `MAX_ARROWS` arrows."""
        arrows = sum(len(points) for each in self.arrows for points in each.points)
        if arrows <= MAX_ARROWS:
            return self
        return self.coarser(max(2, len(self.times) * MAX_ARROWS // arrows))
