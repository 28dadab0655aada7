"""The surface of a soft body as a marker."""

from __future__ import annotations

from geometry_msgs.msg import Point, Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from ..samples import SurfaceSample
from .frames import world_frame
from .stamps import to_ros_time


def surface_message(sample: SurfaceSample, stamp_ns: int) -> Marker:
    """Makes a list of triangles in the world."""
    marker = Marker(ns=sample.name, type=Marker.TRIANGLE_LIST, action=Marker.ADD, scale=Vector3(1.0, 1.0, 1.0))
    marker.header.stamp = to_ros_time(stamp_ns)
    marker.header.frame_id = world_frame()
    marker.pose.orientation.w = 1.0
    marker.color = ColorRGBA(*sample.rgba)
    marker.points = [Point(*corner) for corner in sample.corners]
    return marker
