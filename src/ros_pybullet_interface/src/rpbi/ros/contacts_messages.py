"""Contacts as messages, for programs and for RViz."""

from __future__ import annotations

from geometry_msgs.msg import Point, Vector3
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from ros_pybullet_interface.msg import ContactPoint, Contacts

from ..samples import ContactArrowsSample, ContactsSample
from .frames import world_frame
from .stamps import to_ros_time

_ARROW = Vector3(0.015, 0.03, 0.04)
"""Diameters of shaft and head and length of the head [m]."""
_COLOUR = ColorRGBA(0.85, 0.1, 0.1, 1.0)


def contacts_message(sample: ContactsSample, stamp_ns: int) -> Contacts:
    """Makes the message of a body's contacts."""
    points = [
        ContactPoint(
            link=point.link,
            other_body=point.other_body,
            other_link=point.other_link,
            position=Point(*point.position),
            normal=Vector3(*point.normal),
            depth=point.depth,
            normal_force=point.normal_force,
            friction_direction_1=Vector3(*point.friction_directions[0]),
            friction_force_1=point.friction_forces[0],
            friction_direction_2=Vector3(*point.friction_directions[1]),
            friction_force_2=point.friction_forces[1],
        )
        for point in sample.points
    ]
    return Contacts(_header(stamp_ns), Vector3(*sample.force), points)


def contact_arrows_message(sample: ContactArrowsSample, stamp_ns: int) -> MarkerArray:
    """Makes arrows in place of those before."""
    header = _header(stamp_ns)
    markers = [Marker(header=header, action=Marker.DELETEALL)]
    for number, (start, end) in enumerate(sample.arrows):
        marker = Marker(header=header, ns=sample.name, id=number, type=Marker.ARROW, action=Marker.ADD)
        marker.points = [Point(*start), Point(*end)]
        marker.scale, marker.color = _ARROW, _COLOUR
        marker.pose.orientation.w = 1.0
        markers.append(marker)
    return MarkerArray(markers)


def _header(stamp_ns: int) -> Header:
    return Header(stamp=to_ros_time(stamp_ns), frame_id=world_frame())
