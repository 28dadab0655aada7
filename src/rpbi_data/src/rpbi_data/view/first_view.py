"""Chooses the initial camera of a page, such that all links are visible."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from robot_model.geometry import Vector
from rpbi.bodies.visual_shapes import BodyShape
from rpbi.config.pybullet_world_models import ResetDebugVisualizerCamera

from .scene import Array, ShownLink, TriangleMesh

FOV_RAD = math.radians(45.0)
"""Vertical angle of view [rad]."""
YAW_DEG, PITCH_DEG = 45.0, -30.0
"""Direction of the camera if the world does not configure a camera [deg]."""
LARGE_M = 3.0
"""Extent above which a shape, such as a floor, need not be entirely visible [m]."""
MARGIN = 1.15
"""Factor on the distance at which all links just fit."""
MIN_DISTANCE_M = 0.8
"""Smallest distance of the camera from the middle of the links [m]."""

Camera = tuple[Vector, Vector]
"""Position of a camera and the point that it looks at [m]."""


def first_view(
    own: ResetDebugVisualizerCamera, links: Sequence[ShownLink], meshes: Mapping[BodyShape, TriangleMesh]
) -> Camera:
    """Returns the camera from the world's configuration, or a camera that sees all links at their initial poses.

    Args:
        own: Camera of PyBullet's window in the world's configuration. Default values count as not configured.
        links: Links that the camera must see.
        meshes: Meshes of the links, indexed by shape.
    """
    if own != ResetDebugVisualizerCamera():
        target = np.array(own.cameraTargetPosition)
        return _camera(target, own.cameraDistance, _forward(own.cameraYaw, own.cameraPitch))
    points = _points(links, meshes)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    forward = _forward(YAW_DEG, PITCH_DEG)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    to_points = points - middle
    across = np.abs(np.stack([to_points @ right, to_points @ np.cross(right, forward)])).max(axis=0)
    distance = MARGIN * float((across / math.tan(FOV_RAD / 2) - to_points @ forward).max())
    return _camera(middle, max(MIN_DISTANCE_M, distance), forward)


def _forward(yaw_deg: float, pitch_deg: float) -> Array:
    """Returns the viewing direction of PyBullet's camera in the world frame, as a unit vector of shape (3,)."""
    yaw, pitch = math.radians(yaw_deg), math.radians(pitch_deg)
    return np.array([-math.sin(yaw) * math.cos(pitch), math.cos(yaw) * math.cos(pitch), math.sin(pitch)])


def _camera(target: Array, distance: float, forward: Array) -> Camera:
    return tuple(target - distance * forward), tuple(target)


def _points(links: Sequence[ShownLink], meshes: Mapping[BodyShape, TriangleMesh]) -> Array:
    """Returns points that the camera must see, shape (n, 3) [m].

    For a small shape, these are the corners of its bounding box. For a large shape, this is the point of its bounding
    box that is nearest to the middle of all small shapes. Shapes larger than `LARGE_M` are large.
    """
    corners = [each for link in links for each in _corners(link, meshes)]
    if not corners:
        return np.zeros((1, 3))
    small = [each for each in corners if np.ptp(each, axis=0).max() <= LARGE_M]
    large = [each for each in corners if np.ptp(each, axis=0).max() > LARGE_M]
    seen = np.concatenate(small or large)
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
    return np.concatenate([seen, *(np.clip(middle, each.min(axis=0), each.max(axis=0))[None] for each in large)])


def _corners(link: ShownLink, meshes: Mapping[BodyShape, TriangleMesh]) -> Iterator[Array]:
    """Yields the corners of each shape's box at the time when the link first appears, shape (8, 3) [m]."""
    first = int(np.argmax(link.is_there))
    position, rotation = link.poses.position[first], link.poses.rotation[first]
    for shape in link.shapes:
        if shape in meshes:
            ends = np.stack([meshes[shape].corners.min(axis=0), meshes[shape].corners.max(axis=0)])
        else:
            ends = np.outer((-0.5, 0.5), shape.size)
        corners = np.array(list(itertools.product(*ends.T)))
        in_link = Rotation.from_quat(shape.pose_in_link.quat_xyzw).apply(corners) + shape.pose_in_link.position
        yield rotation.apply(in_link) + position
