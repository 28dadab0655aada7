"""Visual shapes as markers for RViz."""

from __future__ import annotations

from urllib.parse import quote

from geometry_msgs.msg import Point, Quaternion, Vector3
from geometry_msgs.msg import Pose as PoseMessage
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from ..body_shapes import BodyShape, ShapeKind
from ..pose import Pose

MARKER_TYPES = {
    ShapeKind.BOX: Marker.CUBE,
    ShapeKind.SPHERE: Marker.SPHERE,
    ShapeKind.CYLINDER: Marker.CYLINDER,
    ShapeKind.MESH: Marker.MESH_RESOURCE,
    ShapeKind.TRIANGLES: Marker.TRIANGLE_LIST,
}


def shape_marker(name: str, number: int, shape: BodyShape, frame: str, pose: Pose) -> Marker:
    """Returns the marker of a shape, which moves with its frame.

    Args:
        name: The body, for RViz a namespace that can be switched off.
        number: Which of the body's shapes it is.
        shape: The shape.
        frame: TF frame.
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
    """Returns the marker that takes another one away."""
    gone = Marker(ns=marker.ns, id=marker.id, action=Marker.DELETE)
    gone.header.frame_id = marker.header.frame_id
    return gone


def moved(marker: Marker, pose: Pose) -> Marker:
    """Returns the marker at another pose in its frame; the one given stays as it is, since it may be on its way."""
    copied = Marker(*(getattr(marker, slot) for slot in Marker.__slots__))
    copied.pose = pose_message(pose)
    return copied


def pose_message(pose: Pose) -> PoseMessage:
    """Returns a pose as a message."""
    return PoseMessage(Point(*pose.position), Quaternion(*pose.quat_xyzw))
