"""Stamps of the world's clock as ROS times."""

from __future__ import annotations

import genpy

from ..clock import NS_PER_S


def to_ros_time(stamp_ns: int) -> genpy.Time:
    """Returns a stamp [ns] as a ROS time, without going through a float."""
    return genpy.Time(*divmod(stamp_ns, NS_PER_S))
