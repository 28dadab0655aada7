"""Publishes the visual shapes of all bodies as markers, since RViz on its own shows only robots."""

import math
import time
from collections.abc import Iterator
from urllib.parse import quote

import rospy
from geometry_msgs.msg import Point, Quaternion, Vector3
from geometry_msgs.msg import Pose as PoseMessage
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from custom_ros_tools.ros.lifecycle.wall_time import WallRate
from rpbi.bodies import Body
from rpbi.bodies.visual_shapes import BodyShape, ShapeKind, body_shapes, followed_frame, link_frame, link_pose
from rpbi.geometry import Pose
from rpbi.ros.endpoints import Topic
from rpbi.ros.headers import named_frame, prefixed, world_frame
from rpbi.world import World

MARKER_TYPES = {
    ShapeKind.BOX: Marker.CUBE,
    ShapeKind.SPHERE: Marker.SPHERE,
    ShapeKind.CYLINDER: Marker.CYLINDER,
    ShapeKind.MESH: Marker.MESH_RESOURCE,
    ShapeKind.TRIANGLES: Marker.TRIANGLE_LIST,
}


def shape_marker(name: str, number: int, shape: BodyShape, frame: str, pose: Pose) -> Marker:
    """Returns a marker that shows a shape and moves with a TF frame.

    Args:
        name: Name of the body, which becomes the marker's namespace; RViz can hide namespaces.
        number: Number of the shape within the body, which becomes the marker's id.
        shape: The shape.
        frame: TF frame that the marker moves with.
        pose: Pose of the shape in that frame.
    """
    marker = Marker(ns=name, id=number, type=MARKER_TYPES[shape.kind], action=Marker.ADD, frame_locked=True)
    marker.header.frame_id = frame
    marker.pose = pose_message(pose)
    marker.scale = Vector3(*shape.size)
    marker.color = ColorRGBA(*shape.rgba)
    if shape.mesh_file:
        marker.mesh_resource = f"file://{quote(shape.mesh_file)}"
        marker.mesh_use_embedded_materials = shape.is_textured
    marker.points = [Point(*corner) for corner in shape.corners]
    return marker


def deletion(marker: Marker) -> Marker:
    """Returns a marker message that deletes `marker`."""
    gone = Marker(ns=marker.ns, id=marker.id, action=Marker.DELETE)
    gone.header.frame_id = marker.header.frame_id
    return gone


def moved(marker: Marker, pose: Pose) -> Marker:
    """Returns a copy of a marker with another pose in the same frame.

    The original stays unchanged, since rospy may still have to send it.
    """
    copied = Marker(*(getattr(marker, slot) for slot in Marker.__slots__))
    copied.pose = pose_message(pose)
    return copied


def pose_message(pose: Pose) -> PoseMessage:
    """Converts a pose to a message."""
    return PoseMessage(Point(*pose.position), Quaternion(*pose.quat_xyzw))


MARKERS = Topic(
    "rpbi/markers",
    MarkerArray,
    meaning="All visual shapes, for RViz; latched, sent when something comes, goes or moves; `markers_hz`.",
    key="markers_hz",
)
SMALLEST_MOTION = 1e-4
"""Smallest change of a pose that is published: of a coordinate [m] or of a quaternion component."""

LONGEST_CHECK_S = 0.002
"""Longest time that one poll spends on checking shapes [s]; the next poll continues the check."""

_Key = tuple[str, int]


class WorldMarkers:
    """Publishes the visual shapes of all bodies on a latched topic, whenever a shape is added, removed or moved.

    A shape whose link is on TF has a marker in the link's frame, which is not sent again when the link moves. Other
    shapes have markers in the world frame. While the topic has subscribers, the poses of these other shapes are
    checked, and all markers are sent again if one of them has moved. A check of many shapes takes several calls of
    `poll`. Only the simulation thread may create this object and call `poll`.

    Args:
        world: The world.
        hz: Rate [Hz] of the checks, in wall time.
    """

    def __init__(self, world: World, hz: float) -> None:
        self._world = world
        self._rate = WallRate(hz)
        self._seen: tuple[object, ...] = ()
        self._check: Iterator[None] | None = None
        """The running check of all shapes."""
        self._markers: dict[_Key, Marker] = {}
        self._sent: dict[_Key, Marker] = {}
        self._loose: list[tuple[_Key, Body, BodyShape]] = []
        """Shapes of links that are not on TF."""
        self._shown: dict[_Key, Pose] = {}
        """Poses of these shapes when they were last sent."""
        self._publisher = rospy.Publisher(MARKERS.name, MarkerArray, queue_size=100, latch=True)

    def poll(self) -> None:
        """Checks the shapes and publishes changes, if a check is due or has not ended yet."""
        if self._check is None and not self._rate.is_due():
            return
        present = (len(self._world.log), *self._world.bodies.values())
        if present != self._seen:
            self._seen, self._check = present, self._check_all()
        if self._check is not None:
            self._continue(self._check)
        elif self._loose and self._publisher.get_num_connections():
            self._check_loose()

    def _continue(self, check: Iterator[None]) -> None:
        end_s = time.monotonic() + LONGEST_CHECK_S
        for _ in check:
            if time.monotonic() > end_s:
                return
        self._check = None

    def _check_all(self) -> Iterator[None]:
        """Builds the markers of all shapes, yielding after each shape; then publishes all markers if one changed."""
        self._markers, self._loose, self._shown = {}, [], {}
        for body in self._world.bodies.values():
            for number, shape in enumerate(body_shapes(body)):
                self._add((body.name, number), body, shape)
                yield
        gone = [deletion(marker) for key, marker in self._sent.items() if key not in self._markers]
        if gone or self._markers != self._sent:
            self._publisher.publish([*gone, *self._markers.values()])
        self._sent = self._markers

    def _add(self, key: _Key, body: Body, shape: BodyShape) -> None:
        own = link_frame(body, self._world.sensors_of(body.name), shape.link)
        followed = followed_frame(body)
        frame = prefixed(own) if own else named_frame(followed) if followed else None
        pose = shape.pose_in_link
        if frame is None:
            frame = world_frame()
            pose = self._shown[key] = link_pose(body, shape.link_index) @ shape.pose_in_link
            if not _is_finite(pose):
                return
            self._loose.append((key, body, shape))
        self._markers[key] = shape_marker(*key, shape, frame, pose)

    def _check_loose(self) -> None:
        links: dict[tuple[int, int], Pose] = {}
        has_moved = False
        for key, body, shape in self._loose:
            link = body.body_id, shape.link_index
            if link not in links:
                links[link] = link_pose(body, shape.link_index)
            pose = links[link] @ shape.pose_in_link
            if _is_finite(pose) and _differs(pose, self._shown[key]):
                self._shown[key] = pose
                self._markers[key] = moved(self._markers[key], pose)
                has_moved = True
        if has_moved:
            self._publisher.publish(list(self._markers.values()))


def _differs(one: Pose, other: Pose) -> bool:
    pairs = zip((*one.position, *one.quat_xyzw), (*other.position, *other.quat_xyzw))
    return any(abs(a - b) > SMALLEST_MOTION for a, b in pairs)


def _is_finite(pose: Pose) -> bool:
    return math.isfinite(sum(pose.position) + sum(pose.quat_xyzw))
