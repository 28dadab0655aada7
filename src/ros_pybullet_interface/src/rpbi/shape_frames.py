"""Which TF frames are where the links of a body are."""

from __future__ import annotations

from collections.abc import Iterable

from .bodies import Body
from .bodies.shape_object import ShapeObject
from .inputs import PoseInput
from .sensors.link_pose import LinkPoseSensor
from .sensors.sensor import Sensor


def link_frame(body: Body, sensors: Iterable[Sensor], link: str) -> str | None:
    """Returns the frame of ours, such as `rpbi/NAME/LINK`, that TF has of a link; None if it has none.

    A robot of which the root link alone is told leaves the others to robot_state_publisher: they are taken to be there.

    Args:
        body: The body.
        sensors: Its sensors.
        link: Name of the link.
    """
    for sensor in sensors:
        if isinstance(sensor, LinkPoseSensor):
            if link == body.root_link:
                return sensor.root_frame
            if sensor.root_frame == f"rpbi/{body.name}/{body.root_link}":
                return f"rpbi/{body.name}/{link}"
    return None


def followed_frame(body: Body) -> str | None:
    """Returns the frame that the whole body follows, None if it follows none or has joints that move by themselves."""
    if isinstance(body, ShapeObject):
        for taken in body.inputs().values():
            if isinstance(taken, PoseInput):
                return taken.tf_id
    return None
