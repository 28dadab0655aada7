"""The types of sensors; a new one is a class in a file of its own and a line here."""

from __future__ import annotations

from custom_ros_tools.plugins import ClassTable
from rpbi.config.sensors import SensorConfig

from .body_sensor import BodySensor
from .sensor import Sensor

SENSOR_TYPES = ClassTable(
    {
        "joint_state": "rpbi.sensors.joint_state:JointStateSensor",
        "link_pose": "rpbi.sensors.link_pose:LinkPoseSensor",
        "base_state": "rpbi.sensors.base_state:BaseStateSensor",
        "force_torque": "rpbi.sensors.force_torque:ForceTorqueSensor",
        "trajectory_state": "rpbi.sensors.trajectory_state:TrajectoryStateSensor",
        "contacts": "rpbi.sensors.contacts:ContactsSensor",
        "contact_arrows": "rpbi.sensors.contact_arrows:ContactArrowsSensor",
        "surface": "rpbi.sensors.surface:SurfaceSensor",
        "rgbd": "rpbi.sensors.rgbd:RgbdSensor",
    }
)

__all__ = ["SENSOR_TYPES", "BodySensor", "Sensor", "SensorConfig"]
