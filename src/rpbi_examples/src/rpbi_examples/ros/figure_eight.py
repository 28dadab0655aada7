"""Moves a frame in a figure eight."""

from __future__ import annotations

import rospy

from ..figure_eight import position
from .moving_frame import NO_ROTATION, move_frame


def main() -> None:
    """Runs the node; the frame is `~child_frame_id` in `~parent_frame_id`."""
    rospy.init_node("figure_eight")
    parent = rospy.get_param("~parent_frame_id", "rpbi/figure_eight_base")
    child = rospy.get_param("~child_frame_id", "rpbi/figure_eight")
    move_frame(parent, child, lambda time_s: (position(time_s), NO_ROTATION))
