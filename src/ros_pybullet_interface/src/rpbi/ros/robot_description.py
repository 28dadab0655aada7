"""The parameter that tells ROS what a robot looks like."""

from __future__ import annotations

import contextlib
from collections.abc import Callable

import rospy

from ..bodies.jointed import JointedBody
from ..urdf import description_for_ros
from .body_context import BodyContext


def publish_description(context: BodyContext) -> Callable[[], None] | None:
    """Sets `rpbi/NAME/robot_description`, for robot_state_publisher and RViz; returns what deletes it."""
    body = context.body
    if not isinstance(body, JointedBody):
        return None
    name = rospy.resolve_name(f"rpbi/{body.name}/robot_description")
    rospy.set_param(name, description_for_ros(body.config.loadURDF.fileName))

    def withdraw() -> None:
        with contextlib.suppress(KeyError):  # somebody was quicker
            rospy.delete_param(name)

    return withdraw
