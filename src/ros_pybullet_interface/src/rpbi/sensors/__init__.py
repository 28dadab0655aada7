"""The types of sensors; a new one is a class in a file of its own and a line here."""

from __future__ import annotations

from rpbi.config.sensors import SensorConfig

from .base_state import BaseStateSensor
from .body_sensor import BodySensor
from .contact_arrows import ContactArrowsSensor
from .contacts import ContactsSensor
from .force_torque import ForceTorqueSensor
from .joint_state import JointStateSensor
from .link_pose import LinkPoseSensor
from .rgbd import RgbdSensor
from .sensor import Sensor
from .surface import SurfaceSensor
from .trajectory_state import TrajectoryStateSensor

SENSOR_TYPES: dict[str, type[Sensor]] = {
    "joint_state": JointStateSensor,
    "link_pose": LinkPoseSensor,
    "base_state": BaseStateSensor,
    "force_torque": ForceTorqueSensor,
    "trajectory_state": TrajectoryStateSensor,
    "contacts": ContactsSensor,
    "contact_arrows": ContactArrowsSensor,
    "surface": SurfaceSensor,
    "rgbd": RgbdSensor,
}

__all__ = [
    "SENSOR_TYPES",
    "BaseStateSensor",
    "BodySensor",
    "ContactArrowsSensor",
    "ContactsSensor",
    "ForceTorqueSensor",
    "JointStateSensor",
    "LinkPoseSensor",
    "RgbdSensor",
    "Sensor",
    "SensorConfig",
    "SurfaceSensor",
    "TrajectoryStateSensor",
]
