"""Draws moments of a running world with viser."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from typing import Any
from urllib.parse import quote

import numpy as np

from robot_model.geometry import Pose
from rpbi.bodies.visual_shapes import BodyShape

from .meshes import meshes_of
from .moment import CameraItem, Item, LinesItem, Moment, Name, Rgba, ShapeItem, SurfaceItem, TextItem, differs
from .scene import Array, TriangleMesh
from .shapes import add_shape

STILL = 1e-5
"""Change of a coordinate [m] or a quaternion component above which a pose is sent."""
MAX_TRIANGLES = 150_000
"""Number of triangles of bodies that appear together, above which their meshes are simplified."""
FRUSTUM_M = 0.2
"""Height of the frustum of a camera [m]."""
AXIS_M, AXIS_RADIUS_M = 0.12, 0.003
"""Length and radius of the axes of frames [m]."""
FRAMES = "/frames"
SLASH = "\u2215"
"""A character that looks like a slash, for names of nodes, in which slashes separate parts."""

_log = logging.getLogger(__name__)


class _Node:
    """A node of viser that moves with a frame, and the drawn items below it."""

    def __init__(self, api: Any, name: str) -> None:
        self._handle = api.add_frame(name, show_axes=False, visible=False)
        self._position, self._quat_xyzw = Pose()
        self.name = name
        self.items: set[Name] = set()

    def move(self, pose: Pose | None) -> None:
        """Moves the node if its pose has changed, or hides the node if its pose is None."""
        if (pose is not None) != self._handle.visible:
            self._handle.visible = pose is not None
        if pose is None:
            return
        if differs(pose.position, self._position, STILL):
            self._handle.position = self._position = pose.position
        if differs(pose.quat_xyzw, self._quat_xyzw, STILL):
            self._quat_xyzw = pose.quat_xyzw
            self._handle.wxyz = _wxyz(pose)

    def remove(self) -> None:
        """Removes the node and all that is below it."""
        self._handle.remove()


class LiveScene:
    """Draws a moment, and sends only the changes since the moment that was drawn before.

    Each item is below a node of its frame, such as `/box/rpbi∕box/0`; viewers can hide nodes by their names.

    Args:
        server: The server of viser.
    """

    def __init__(self, server: Any) -> None:
        self._server, self._api = server, server.scene
        self._groups: dict[str, Any] = {}
        self._nodes: dict[tuple[str, str], _Node] = {}
        self._items: Mapping[Name, Item] = {}
        self._drawn: dict[Name, Item] = {}
        self._handles: dict[Name, Any] = {}
        self._frames: Any = None
        self._labels: dict[str, Any] = {}
        self.shows_frames = self.shows_names = False
        self.meshes: Mapping[BodyShape, TriangleMesh] = {}
        """Meshes of the shapes that were drawn first."""
        self.notes: list[str] = []
        """Messages about meshes that cannot be shown, or are simplified."""

    def show(self, moment: Moment) -> None:
        """Draws a moment."""
        poses = moment.poses()
        with self._server.atomic():
            if moment.items is not self._items:
                self._show_items(moment.items)
                self._items = moment.items
            for (_, frame), node in self._nodes.items():
                node.move(poses.get(frame))
            self._show_frames({name: poses[name] for name in moment.frames if name in poses})

    def camera(self, name: Name) -> Any:
        """Returns viser's handle of a camera, whose `image` can be set; None if the camera is not drawn."""
        return self._handles.get(name)

    def _show_items(self, items: Mapping[Name, Item]) -> None:
        gone = [name for name, item in self._drawn.items() if not _continues(item, items.get(name))]
        for name in gone:
            self._remove(name)
        changed = {name: item for name, item in items.items() if self._drawn.get(name) is not item}
        for name in changed.keys() & self._drawn.keys():
            _update(self._handles[name], changed[name])
        new = {name: item for name, item in changed.items() if name not in self._drawn}
        meshes = self._meshes(item.shape for item in new.values() if isinstance(item, ShapeItem))
        for name, item in new.items():
            self._add(name, item, meshes)
        self._drawn.update(changed)

    def _meshes(self, shapes: Iterable[BodyShape]) -> Mapping[BodyShape, TriangleMesh]:
        meshes, notes = meshes_of(shapes, MAX_TRIANGLES)
        self.meshes = self.meshes or meshes
        for note in notes:
            if note not in self.notes:
                self.notes.append(note)
                _log.warning("%s", note)
        return meshes

    def _add(self, name: Name, item: Item, meshes: Mapping[BodyShape, TriangleMesh]) -> None:
        key = name[0], item.frame
        if name[0] not in self._groups:
            self._groups[name[0]] = self._api.add_frame(f"/{_part(name[0])}", show_axes=False)
        if key not in self._nodes:
            self._nodes[key] = _Node(self._api, f"/{_part(name[0])}/{_part(item.frame)}")
        node = self._nodes[key]
        node.items.add(name)
        path = f"{node.name}/{_part(name[1])}"
        if isinstance(item, ShapeItem):
            self._handles[name] = add_shape(self._api, path, item.shape, meshes)
        else:
            self._handles[name] = _drawn_item(self._api, path, item)

    def _remove(self, name: Name) -> None:
        item, handle = self._drawn.pop(name), self._handles.pop(name)
        key = name[0], item.frame
        node = self._nodes[key]
        node.items.discard(name)
        if not node.items:
            self._nodes.pop(key).remove()
            if not any(group == name[0] for group, _ in self._nodes):
                self._groups.pop(name[0]).remove()
        elif handle is not None:
            handle.remove()

    def _show_frames(self, poses: Mapping[str, Pose]) -> None:
        """Shows the axes and the names of frames, if the user wants to see them."""
        names = sorted(poses) if self.shows_frames else []
        if not names and self._frames is None:
            return
        for name in self._labels.keys() - set(names if self.shows_names else ()):
            self._labels.pop(name).remove()
        if not names:
            self._frames.remove()
            self._frames = None
            return
        positions = np.array([poses[name].position for name in names], np.float32)
        wxyzs = np.array([_wxyz(poses[name]) for name in names], np.float32)
        if self._frames is None or len(self._frames.batched_positions) != len(names):
            self._frames = self._api.add_batched_axes(
                FRAMES, wxyzs, positions, axes_length=AXIS_M, axes_radius=AXIS_RADIUS_M
            )
        else:
            self._frames.batched_positions, self._frames.batched_wxyzs = positions, wxyzs
        for name in names if self.shows_names else ():
            if name not in self._labels:
                self._labels[name] = self._api.add_label(f"/names/{_part(name)}", name)
            self._labels[name].position = poses[name].position


def _continues(item: Item, later: Item | None) -> bool:
    """Returns whether the node of a drawn item can show a later item."""
    if later is item:
        return True
    if later is None or type(later) is not type(item) or later.frame != item.frame:
        return False
    if isinstance(item, ShapeItem) and isinstance(later, ShapeItem):
        return later.shape._replace(pose_in_link=item.shape.pose_in_link) == item.shape
    if isinstance(later, TextItem | CameraItem) or later.pose != item.pose:
        return False
    if isinstance(item, SurfaceItem) and isinstance(later, SurfaceItem):
        return len(later.corners) == len(item.corners) and later.rgba == item.rgba
    assert isinstance(item, LinesItem) and isinstance(later, LinesItem)
    same = (later.rgba, later.width_m, later.are_arrows) == (item.rgba, item.width_m, item.are_arrows)
    return same and bool(len(later.points)) and bool(len(item.points))


def _update(handle: Any, item: Item) -> None:
    if handle is None:  # its mesh cannot be read
        return
    if isinstance(item, ShapeItem):
        handle.position, handle.wxyz = item.pose.position, _wxyz(item.pose)
    elif isinstance(item, SurfaceItem):
        handle.vertices = item.corners
    elif isinstance(item, LinesItem):
        handle.points = item.points


def _drawn_item(api: Any, name: str, item: Item) -> Any:
    """Adds an item that is no rigid shape to a scene of viser; returns viser's handle, or None for an empty item."""
    pose = {"position": item.pose.position, "wxyz": _wxyz(item.pose)}
    if isinstance(item, SurfaceItem) and len(item.corners):
        faces = np.arange(len(item.corners), dtype=np.uint32).reshape(-1, 3)
        rgb, opacity = _colour(item.rgba)
        flat: dict[str, Any] = {"side": "double", "flat_shading": True, "color": rgb, "opacity": opacity, **pose}
        return api.add_mesh_simple(name, item.corners, faces, **flat)
    if isinstance(item, LinesItem) and len(item.points):
        rgb, _ = _colour(item.rgba)
        if not item.are_arrows:
            return api.add_line_segments(name, item.points, rgb, thickness=item.width_m, **pose)
        sizes = {"shaft_radius": item.width_m / 2, "head_radius": item.width_m, "head_length": 3 * item.width_m}
        return api.add_arrows(name, item.points, rgb, **sizes, **pose)
    if isinstance(item, TextItem):
        return api.add_label(name, item.text, position=item.pose.position)
    if isinstance(item, CameraItem):
        return api.add_camera_frustum(
            name, item.fov_rad, item.aspect, scale=FRUSTUM_M, thickness=FRUSTUM_M / 100, **pose
        )
    return None


def _colour(rgba: Rgba) -> tuple[Array, float | None]:
    rgb = np.clip(np.round(255 * np.array(rgba[:3])), 0, 255).astype(np.uint8)
    return rgb, None if rgba[3] >= 1.0 else max(0.0, rgba[3])


def _wxyz(pose: Pose) -> tuple[float, float, float, float]:
    x, y, z, w = pose.quat_xyzw
    return w, x, y, z


def _part(name: str) -> str:
    """Converts any name to a part of a node's name, which is unique and not empty. Viewers see these names."""
    return name.replace("%", "%25").replace(SLASH, quote(SLASH)).replace("/", SLASH) or "-"
