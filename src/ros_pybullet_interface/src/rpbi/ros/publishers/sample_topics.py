"""The topic of each type of samples."""

from __future__ import annotations

from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker, MarkerArray

from custom_ros_tools.errors import ConfigError, Problem
from ros_pybullet_interface.msg import Contacts
from rpbi.control.trajectories.controller_state import ControllerState
from rpbi.plugins import full_name
from rpbi.ros.endpoints import Topic, find_topic
from rpbi.ros.robots.trajectory_messages import CONTROLLER, JointTrajectoryControllerState, state_message
from rpbi.samples import (
    BaseStateSample,
    ContactArrowsSample,
    ContactsSample,
    JointStateSample,
    LinkPoseSample,
    SceneSample,
    SurfaceSample,
    WrenchSample,
)
from rpbi.sensors.sensor import Sensor

from .messages import (
    contact_arrows_message,
    contacts_message,
    joint_state_message,
    odometry_message,
    surface_message,
    wrench_message,
)

TOPICS: dict[type, Topic] = {
    WrenchSample: Topic(
        "rpbi/{name}/ft_sensor",
        WrenchStamped,
        wrench_message,
        "Force [N] and moment [N m] in the joint, in the frame of its child link; "
        "`hz` of `enabled_joint_force_torque_sensors`.",
    ),
    JointStateSample: Topic(
        "rpbi/{name}/joint_states",
        JointState,
        joint_state_message,
        "Position [rad or m], velocity and the motor's effort [N m or N] of all joints, fixed ones too, in the URDF's "
        "order; `joint_state_publisher_hz`.",
    ),
    BaseStateSample: Topic(
        "rpbi/{name}/base_state",
        Odometry,
        odometry_message,
        "Pose of the root link in the world [m], its velocity in its own axes [m/s, rad/s]; `base_state_hz`.",
    ),
    ContactsSample: Topic(
        "rpbi/{name}/contacts",
        Contacts,
        contacts_message,
        "Where others touch the body, and their forces on it [N]; `contacts.hz`.",
    ),
    SurfaceSample: Topic(
        "rpbi/{name}/surface", Marker, surface_message, "The surface as triangles, for RViz; `surface_hz`."
    ),
    ContactArrowsSample: Topic(
        "rpbi/{name}/contacts/arrows",
        MarkerArray,
        contact_arrows_message,
        "The forces as arrows, for RViz; `contacts.arrows_hz`.",
    ),
    ControllerState: Topic(
        f"rpbi/{{name}}/{CONTROLLER}/state",
        JointTrajectoryControllerState,
        state_message,
        "Where joints are to be on the trajectory, and where they are; `state_publish_rate`.",
    ),
}
"""The topic of each type of samples that has topics of its own."""

_ELSEWHERE = (LinkPoseSample, SceneSample)
"""Samples that go to TF and to the renderer."""


def sample_topic(sensor: Sensor) -> Topic | None:
    """Returns the topic of a sensor, None if its samples go elsewhere.

    Raises:
        ConfigError: If it comes from another package and has no topic that can be found.
    """
    if sensor.sample_type in _ELSEWHERE:
        return None
    if sensor.ros_topic:
        return find_topic(sensor.ros_topic, sensor)
    if sensor.sample_type not in TOPICS:
        message = f"missing, expected 'module:NAME' of the Topic for its {sensor.sample_type.__qualname__}"
        raise ConfigError([Problem(full_name(sensor), "ros_topic", message)])
    return TOPICS[sensor.sample_type]
