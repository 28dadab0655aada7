"""The types of sensors; a new one is a class in a file of its own and a line here."""

from __future__ import annotations

from .joint_state import JointStateSensor
from .link_pose import LinkPoseSensor
from .rgbd import RgbdSensor
from .sensor import Sensor

SENSOR_TYPES: dict[str, type[Sensor]] = {
    "joint_state": JointStateSensor,
    "link_pose": LinkPoseSensor,
    "rgbd": RgbdSensor,
}

__all__ = ["SENSOR_TYPES", "JointStateSensor", "LinkPoseSensor", "RgbdSensor", "Sensor"]
