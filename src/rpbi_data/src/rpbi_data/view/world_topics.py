"""Receives the content of a live view from the topics of a running simulator: frames, markers, cameras and images.

Topics are found by their types, so that markers of other nodes and cameras that are added later are shown, too.
"""

from __future__ import annotations

import io
import json
import logging
import math
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple
from urllib.parse import unquote, urlsplit

import numpy as np
import rospy
from PIL import Image as Picture
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.topic_table import TopicRow, TopicTable
from robot_model.asset_files import find_file
from robot_model.geometry import Pose, normalized
from ros_pybullet_interface.msg import SimulationState
from rpbi.bodies.visual_shapes import BodyShape, ShapeKind
from rpbi.config.pybullet_world_models import ResetDebugVisualizerCamera
from rpbi.config.world import WORLD_FRAME

from .moment import CameraItem, Item, LinesItem, Moment, Name, Placed, ShapeItem, SurfaceItem, TextItem, is_finite
from .scene import Array

MAX_FRAME_AGE_S, TF_PAUSE_S = 10.0, 1.0
"""A frame is removed if it was not published for `MAX_FRAME_AGE_S`, while others were in the last `TF_PAUSE_S` [s]."""
MAX_IMAGE_PX = 480
"""Width of an image in the view; larger images are scaled down [px]."""
MAX_IMAGE_BYTES = 50_000_000
MAX_POINTS = 300_000
"""Maximum number of points of a marker; a larger marker is not shown."""
MAX_REFUSED = 50
"""Maximum number of warnings about markers that cannot be shown."""
LINE_M = 0.004
CAMERA = "camera"
SHAPES = {
    Marker.CUBE: ShapeKind.BOX,
    Marker.SPHERE: ShapeKind.SPHERE,
    Marker.CYLINDER: ShapeKind.CYLINDER,
    Marker.MESH_RESOURCE: ShapeKind.MESH,
}
LAYOUTS = {
    "rgb8": ("u1", 3, [0, 1, 2]),
    "bgr8": ("u1", 3, [2, 1, 0]),
    "mono8": ("u1", 1, [0, 0, 0]),
    "32FC1": ("f4", 1, [0, 0, 0]),
    "16UC1": ("u2", 1, [0, 0, 0]),
    "mono16": ("u2", 1, [0, 0, 0]),
}
"""Encodings of shown raw images: type of a value, number of channels, and indices of red, green and blue."""

_log = logging.getLogger(__name__)


class _Received(NamedTuple):
    """An item from a topic, and the time after which it is removed [s]."""

    item: Item
    end_s: float = math.inf


class TopicSource:
    """Follows the topics of a simulator in a namespace.

    Args:
        namespace: Namespace of the topics, with slashes at both ends.

    Attributes:
        camera: Camera of PyBullet's window in the configuration of the world; None if it is not known yet.
        state: Last message on `rpbi/state`; None before the first one.
        table: Topics and services of the ROS system.
    """

    def __init__(self, namespace: str) -> None:
        self._namespace, self._world = namespace, WORLD_FRAME
        self._lock = threading.Lock()
        self._frames: dict[str, tuple[Placed, float]] = {}
        """Poses of frames, and the times of their last messages [s]; inf for static frames."""
        self._tf_s = 0.0
        self._received: dict[str, dict[Name, _Received]] = {}
        """Items, indexed by topic and name."""
        self._items: dict[Name, Item] = {}
        self._refused: set[Name] = set()
        """Markers that cannot be shown, of which a warning was logged."""
        self._subscribers: dict[str, rospy.Subscriber] = {}
        self._image: rospy.Subscriber | None = None
        self._image_topic = ""
        self._picture: tuple[float, Any] = (0.0, None)
        self.camera: ResetDebugVisualizerCamera | None = None
        self.state: SimulationState | None = None
        self._state_s = -math.inf
        for topic, is_static in (("/tf", False), ("/tf_static", True)):
            rospy.Subscriber(topic, TFMessage, partial(self._on_tf, is_static), queue_size=100, tcp_nodelay=True)
        rospy.Subscriber(f"{namespace}rpbi/state", SimulationState, self._on_state, queue_size=1)
        rospy.Subscriber(f"{namespace}rpbi/world_description", String, self._on_description, queue_size=1)
        self.table = TopicTable(self._on_topic)
        self.table.watch()

    def moment(self) -> Moment:
        """Returns frames and items as they are now. A returned moment never changes."""
        now_s = time.monotonic()
        with self._lock:
            if any(now_s > each.end_s for of_topic in self._received.values() for each in of_topic.values()):
                for of_topic in self._received.values():
                    for name in [name for name, each in of_topic.items() if now_s > each.end_s]:
                        del of_topic[name]
                self._collect()
            if now_s - self._tf_s < TF_PAUSE_S:
                oldest_s = now_s - MAX_FRAME_AGE_S
                self._frames = {name: each for name, each in self._frames.items() if each[1] > oldest_s}
            frames = {name: placed for name, (placed, _) in self._frames.items()}
            items, state = self._items, self.state
        return Moment(now_s, state.simulated_time if state else 0.0, self._world, frames, items)

    @property
    def state_age_s(self) -> float:
        """Time since the last message on `rpbi/state` [s]."""
        return time.monotonic() - self._state_s

    @property
    def images(self) -> list[str]:
        """Sorted names of all topics with images that can be shown, without the namespace."""
        rows = self.table.rows.values()
        return sorted(
            row.name.removeprefix(self._namespace)
            for row in rows
            if row.name.startswith(self._namespace)
            and (row.type == CompressedImage._type or (row.type == Image._type and not _is_compressed(row, rows)))
        )

    def choose_image(self, topic: str) -> None:
        """Subscribes to a topic with images, which is one of `images`; an empty text ends the subscription."""
        if topic == self._image_topic:
            return
        if self._image is not None:
            self._image.unregister()
        self._image, self._image_topic, self._picture = None, topic, (0.0, None)
        row = self.table.rows.get(f"{self._namespace}{topic}") if topic else None
        if row is not None:
            kind = CompressedImage if row.type == CompressedImage._type else Image
            self._image = rospy.Subscriber(row.name, kind, self._on_image, queue_size=1, buff_size=MAX_IMAGE_BYTES)

    def picture(self) -> tuple[float, Array | None, Name | None]:
        """Returns the newest image of the chosen topic.

        Returns:
            The time of the image's arrival on the monotonic clock [s], its pixels as an array of shape (height, width,
            3), or None without an image that can be read, and the name of the camera's item, if it is known.
        """
        arrival_s, message = self._picture
        if message is None:
            return arrival_s, None, None
        name = CAMERA, message.header.frame_id.lstrip("/")
        return arrival_s, pixels_of(message), name if name in self._items else None

    def _on_tf(self, is_static: bool, message: TFMessage) -> None:
        now_s = time.monotonic()
        with self._lock:
            for each in message.transforms:
                position, quat = each.transform.translation, each.transform.rotation
                pose = Pose((position.x, position.y, position.z), (quat.x, quat.y, quat.z, quat.w))
                if is_finite(pose):
                    parent, child = each.header.frame_id.lstrip("/"), each.child_frame_id.lstrip("/")
                    self._frames[child] = Placed(parent, pose), math.inf if is_static else now_s
            if not is_static:
                self._tf_s = now_s

    def _on_state(self, message: SimulationState) -> None:
        self.state, self._state_s = message, time.monotonic()

    def _on_description(self, message: String) -> None:
        """Reads the prefix of TF frames, and the camera."""
        try:
            (config,) = json.loads(json.loads(message.data)["config"]).values()
            self._world = f"{config.get('tf_prefix') or ''}/{WORLD_FRAME}".lstrip("/")
            own = config.get("resetDebugVisualizerCamera", {})
            self.camera = ResetDebugVisualizerCamera.parse(own, "rpbi/world_description")
        except (ValueError, KeyError, AttributeError, InterfaceError) as error:
            _log.warning("the description of the world cannot be read: %s", error)

    def _on_topic(self, before: TopicRow | None, after: TopicRow | None) -> None:
        """Subscribes to a topic that is shown. Begins anew if a publisher has left, whose items must not stay."""
        name = (after or before).name  # type: ignore[union-attr]
        if not name.startswith(self._namespace):
            return
        if before is not None and (after is None or after.type != before.type or before.publishers - after.publishers):
            if name in self._subscribers:
                self._subscribers.pop(name).unregister()
            with self._lock:
                self._received.pop(name, None)
                self._collect()
        if after is not None and after.type in _HANDLERS and name not in self._subscribers:
            kind, method = _HANDLERS[after.type]
            self._subscribers[name] = rospy.Subscriber(name, kind, partial(method, self, name), queue_size=20)

    def _on_markers(self, topic: str, message: MarkerArray) -> None:
        self._apply(topic, message.markers)

    def _on_marker(self, topic: str, message: Marker) -> None:
        self._apply(topic, [message])

    def _apply(self, topic: str, markers: list[Marker]) -> None:
        now_s = time.monotonic()
        items = list(self._items_of(topic, markers))
        with self._lock:
            known = self._received.get(topic, {})
            of_topic = {} if topic == f"{self._namespace}rpbi/markers" else dict(known)  # that one is always complete
            for name, item, lifetime_s in items:
                if item is None or name is None:
                    of_topic = {each: kept for each, kept in of_topic.items() if name not in (None, each)}
                    continue
                before = known.get(name)
                if before is not None and _equals(before.item, item):
                    item = before.item
                of_topic[name] = _Received(item, now_s + lifetime_s if lifetime_s > 0.0 else math.inf)
            self._received[topic] = of_topic
            self._collect()

    def _items_of(self, topic: str, markers: list[Marker]) -> Iterator[tuple[Name | None, Item | None, float]]:
        """Yields names, items and lifetimes [s]; no item to remove the item of a name, no name either to remove all.

        Arrows that replace all markers of a topic, such as contact forces, become one item for each namespace.
        """
        is_complete = bool(markers) and markers[0].action == Marker.DELETEALL
        arrows: dict[str, LinesItem] = {}
        for marker in markers:
            name = marker.ns or topic, f"{topic} {marker.id}"
            if marker.action in (Marker.DELETEALL, Marker.DELETE):
                yield None if marker.action == Marker.DELETEALL else name, None, 0.0
                continue
            try:
                item = item_of(marker, self._world)
            except (ValueError, OSError) as error:
                if name not in self._refused and len(self._refused) < MAX_REFUSED:
                    self._refused.add(name)
                    _log.warning("%s: marker %d of '%s' is not shown: %s", topic, marker.id, marker.ns, error)
                continue
            if is_complete and isinstance(item, LinesItem) and item.are_arrows:
                first = arrows.get(name[0], item)
                if (first.frame, first.pose, first.rgba) == (item.frame, item.pose, item.rgba):
                    points = item.points if first is item else np.concatenate([first.points, item.points])
                    arrows[name[0]] = replace(first, points=points)
                    continue
            yield name, item, marker.lifetime.to_sec()
        for group, arrow in arrows.items():
            yield (group, topic), arrow, 0.0

    def _on_camera(self, topic: str, message: CameraInfo) -> None:
        if not (message.K[4] > 0.0 and message.height and message.width):
            return
        fov_rad = 2.0 * math.atan(message.height / 2.0 / message.K[4])
        frame = message.header.frame_id.lstrip("/")
        item = CameraItem(frame, Pose(), fov_rad, message.width / message.height)
        with self._lock:
            self._received[topic] = {(CAMERA, frame): _Received(item)}
            self._collect()
            subscriber = self._subscribers.pop(topic, None)
        if subscriber is not None:
            subscriber.unregister()  # a simulator draws images as long as someone wants to know the camera

    def _on_image(self, message: Any) -> None:
        self._picture = time.monotonic(), message

    def _collect(self) -> None:
        """Makes a new mapping of all items; moments that were returned keep the former one."""
        self._items = {name: each.item for of_topic in self._received.values() for name, each in of_topic.items()}


_HANDLERS: dict[str, tuple[type, Callable[[TopicSource, str, Any], None]]] = {
    MarkerArray._type: (MarkerArray, TopicSource._on_markers),
    Marker._type: (Marker, TopicSource._on_marker),
    CameraInfo._type: (CameraInfo, TopicSource._on_camera),
}
"""Message type and handler of the topics that are shown, indexed by the name of the type."""


def item_of(marker: Marker, world: str) -> Item:
    """Converts a marker to an item.

    Args:
        marker: The marker.
        world: Name of the world frame, for a marker without a frame.

    Raises:
        ValueError: If the marker cannot be shown.
        OSError: If the file of its mesh cannot be found.
    """
    position, quat, size = marker.pose.position, marker.pose.orientation, marker.scale
    xyzw = (quat.x, quat.y, quat.z, quat.w) if quat.x or quat.y or quat.z or quat.w else (0.0, 0.0, 0.0, 1.0)
    pose = Pose((position.x, position.y, position.z), xyzw)
    if not is_finite(pose):
        raise ValueError("its pose is not finite")
    pose = Pose(pose.position, normalized(pose.quat_xyzw))
    frame = marker.header.frame_id.lstrip("/") or world
    red, green, blue, alpha = np.clip((marker.color.r, marker.color.g, marker.color.b, marker.color.a), 0.0, 1.0)
    rgba = float(red), float(green), float(blue), float(alpha)
    if marker.type in SHAPES:
        kind = SHAPES[marker.type]
        if kind is ShapeKind.MESH and not any(rgba):  # only the materials of the mesh
            rgba = 0.7, 0.7, 0.7, 1.0
        file = _mesh_file(marker.mesh_resource) if kind is ShapeKind.MESH else ""
        shape = BodyShape(-1, marker.ns, kind, (size.x, size.y, size.z), pose, rgba, file)  # type: ignore[arg-type]
        return ShapeItem(frame, pose, shape)
    if marker.type == Marker.TEXT_VIEW_FACING:
        return TextItem(frame, pose, marker.text)
    points = np.array([(each.x, each.y, each.z) for each in marker.points[: MAX_POINTS + 1]], np.float32).reshape(-1, 3)
    if len(points) > MAX_POINTS or not np.isfinite(points).all():
        raise ValueError(f"expected at most {MAX_POINTS} finite points")
    if marker.type == Marker.TRIANGLE_LIST and len(points) % 3 == 0:
        return SurfaceItem(frame, pose, points * np.array((size.x, size.y, size.z), np.float32), rgba)
    if marker.type == Marker.ARROW:
        if len(points) == 0:
            points = np.array([(0.0, 0.0, 0.0), (size.x, 0.0, 0.0)], np.float32)
            return LinesItem(frame, pose, points[None], rgba, size.y, True)
        if len(points) == 2:
            return LinesItem(frame, pose, points[None], rgba, size.x, True)
    if marker.type == Marker.LINE_STRIP:
        return LinesItem(frame, pose, np.stack([points[:-1], points[1:]], 1), rgba, size.x or LINE_M, False)
    if marker.type == Marker.LINE_LIST and len(points) % 2 == 0:
        return LinesItem(frame, pose, points.reshape(-1, 2, 3), rgba, size.x or LINE_M, False)
    raise ValueError(f"its type is {marker.type}, with {len(points)} points")


def pixels_of(message: Any) -> Array | None:
    """Returns the pixels of an image message, scaled to at most `MAX_IMAGE_PX` columns, shape (height, width, 3).

    Returns None if the image cannot be read.
    """
    try:
        if isinstance(message, Image):
            kind, channels, order = LAYOUTS[message.encoding]
            rows = np.frombuffer(message.data, np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<"))
            rows = rows.reshape(message.height, -1)[:, : message.width * channels]
            pixels = rows.reshape(message.height, message.width, channels)[..., order]
            if kind != "u1":  # such as depth: from black to white, the greatest finite value
                values = np.nan_to_num(pixels.astype(float), nan=0.0, posinf=0.0, neginf=0.0)
                pixels = (255.0 * np.clip(values / (values.max() or 1.0), 0.0, 1.0)).astype(np.uint8)
            picture = Picture.fromarray(pixels)
        else:
            picture = Picture.open(io.BytesIO(message.data), formats=("JPEG", "PNG"))
            picture.draft("RGB", (MAX_IMAGE_PX, MAX_IMAGE_PX))
            picture = picture.convert("RGB")
        picture.thumbnail((MAX_IMAGE_PX, MAX_IMAGE_PX))
        return np.asarray(picture)
    except (KeyError, ValueError, OSError, Picture.DecompressionBombError):
        return None


def _mesh_file(resource: str) -> str:
    parts = urlsplit(resource)
    if parts.scheme not in ("file", "package"):
        raise ValueError(f"expected a mesh of a file or a package, got {resource}")
    path = unquote(parts.path)
    return find_file(path if parts.scheme == "file" else f"{{{parts.netloc}}}{path}", path)


def _equals(one: Item, other: Item) -> bool:
    """Returns whether two items are drawn the same way."""
    if type(one) is not type(other):
        return False
    pairs = zip(vars(one).values(), vars(other).values(), strict=True)
    return all(np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b for a, b in pairs)


def _is_compressed(row: TopicRow, rows: Any) -> bool:
    return any(each.name == f"{row.name}/compressed" for each in rows)
