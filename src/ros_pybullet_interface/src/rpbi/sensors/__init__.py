"""The types of sensors; a new one is a class in a file of its own and a line here."""

from custom_ros_tools.plugins import ClassTable, find_class
from rpbi.config.sensors import SensorConfig

from .sensor import BodySensor, Sensor

SENSOR_TYPES = ClassTable(
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
    }
)


def sensor_class(kind: str) -> type[BodySensor]:
    """Returns the class of sensors that a body's YAML asks for by a key of SENSOR_TYPES or by `module:Class`.

    Raises:
        ValueError: If there is none.
    """
    known = SENSOR_TYPES.get(kind, Sensor)
    found: type[BodySensor] = known if issubclass(known, BodySensor) else find_class(kind, BodySensor)
    return found


__all__ = ["SENSOR_TYPES", "BodySensor", "Sensor", "SensorConfig", "sensor_class"]
