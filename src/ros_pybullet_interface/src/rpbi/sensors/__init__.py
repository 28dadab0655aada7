"""The types of sensors; to add a type, write a class in its own file and add a line to the table below."""

from custom_ros_tools.plugin_table import PluginTable
from rpbi.config.sensors import SensorConfig

from .sensor import BodySensor, Sensor

SENSOR_TYPES: PluginTable[BodySensor] = PluginTable(
    "sensor",
    "rpbi.sensors.sensor:BodySensor",
    {
        "joint_state": "rpbi.sensors.joint_state:JointStateSensor",
        "link_pose": "rpbi.sensors.link_pose:LinkPoseSensor",
        "base_state": "rpbi.sensors.base_state:BaseStateSensor",
        "force_torque": "rpbi.sensors.force_torque:ForceTorqueSensor",
        "trajectory_state": "rpbi.sensors.trajectory_state:TrajectoryStateSensor",
        "controller_state": "rpbi.sensors.controller_state:ControllerStateSensor",
        "contacts": "rpbi.sensors.contacts.contacts:ContactsSensor",
        "mean_contacts": "rpbi.sensors.contacts.mean:MeanContactsSensor",
        "contact_arrows": "rpbi.sensors.contacts.arrows:ContactArrowsSensor",
        "surface": "rpbi.sensors.surface:SurfaceSensor",
        "rgbd": "rpbi.sensors.rgbd:RgbdSensor",
        "vicon": "rpbi.sensors.tracking.vicon:ViconSensor",
        "april_tags": "rpbi.sensors.tracking.april_tags:AprilTagsSensor",
    },
    suggests=False,
)
"""All types of sensors. The YAML key `sensors` of any object can list a `BodySensor`; other sensors have own keys."""

__all__ = ["SENSOR_TYPES", "BodySensor", "Sensor", "SensorConfig"]
