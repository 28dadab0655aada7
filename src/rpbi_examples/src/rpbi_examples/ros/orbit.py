"""Moves the camera's frame around the scene."""

from __future__ import annotations

import rospy

from custom_ros_tools.ros.lifecycle.run_node import run_node
from rpbi_examples.orbit import camera_pose

from .moving_frame import move_frame


def main() -> None:
    """Runs the node; the frame is `~child_frame_id`, by default `rpbi/camera`."""
    run_node("orbit", lambda: move_frame("rpbi/world", rospy.get_param("~child_frame_id", "rpbi/camera"), camera_pose))
