"""The topic of each type of samples."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from geometry_msgs.msg import Vector3, Wrench, WrenchStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker, MarkerArray

from custom_ros_tools.errors import ConfigError, Problem
from custom_ros_tools.plugins import find, full_name
from ros_pybullet_interface.msg import Contacts
from rpbi.control.trajectories.controller_state import ControllerState
from rpbi.ros.headers import prefixed, to_ros_time
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

from .messages import contact_arrows_message, contacts_message, odometry_message, surface_message


def find_topic(name: str, kind: type, owner: Any) -> Any:
    """Returns a topic of another package.

    Args:
        name: Where it is, as `module:NAME`.
        kind: What it should be: SampleTopic or TopicInput.
        owner: The sensor or body that names it as its `ros_topic`.

    Raises:
        ConfigError: If there is no such thing; it names the class of the owner.
    """
    try:
        found = find(name)
        if not isinstance(found, kind):
            raise ValueError(f"expected a {full_name(kind)} in '{name}', got {found!r}")
    except ValueError as error:
        raise ConfigError([Problem(full_name(owner), "ros_topic", str(error))]) from None
    return found


class SampleTopic(NamedTuple):
    """The topic of one type of samples.

    Attributes:
        topic: Its name, with `{name}` for the sensor.
        message_type: ROS type.
        to_message: Makes the message of a sample and its stamp [ns].
        meaning: What it tells and which key sets its rate, in a sentence.
    """

    topic: str
    message_type: type
    to_message: Callable[[Any, int], Any]
    meaning: str = ""


def joint_state_message(sample: JointStateSample, stamp_ns: int) -> JointState:
    message = JointState(
        name=sample.joint_names, position=sample.position, velocity=sample.velocity, effort=sample.effort
    )
    message.header.stamp = to_ros_time(stamp_ns)
    return message


def wrench_message(sample: WrenchSample, stamp_ns: int) -> WrenchStamped:
    message = WrenchStamped(wrench=Wrench(Vector3(*sample.force), Vector3(*sample.torque)))
    is_ours = sample.frame_id.startswith("rpbi/")
    message.header.frame_id = prefixed(sample.frame_id) if is_ours else sample.frame_id
    message.header.stamp = to_ros_time(stamp_ns)
    return message


TOPICS: dict[type, SampleTopic] = {
    WrenchSample: SampleTopic(
        "rpbi/{name}/ft_sensor",
        WrenchStamped,
        wrench_message,
        "Force [N] and moment [N m] in the joint, in the frame of its child link; "
        "`hz` of `enabled_joint_force_torque_sensors`.",
    ),
    JointStateSample: SampleTopic(
        "rpbi/{name}/joint_states",
        JointState,
        joint_state_message,
        "Position [rad or m], velocity and the motor's effort [N m or N] of all joints, fixed ones too, in the URDF's "
        "order; `joint_state_publisher_hz`.",
    ),
    BaseStateSample: SampleTopic(
        "rpbi/{name}/base_state",
        Odometry,
        odometry_message,
        "Pose of the root link in the world [m], its velocity in its own axes [m/s, rad/s]; `base_state_hz`.",
    ),
    ContactsSample: SampleTopic(
        "rpbi/{name}/contacts",
        Contacts,
        contacts_message,
        "Where others touch the body, and their forces on it [N]; `contacts.hz`.",
    ),
    SurfaceSample: SampleTopic(
        "rpbi/{name}/surface", Marker, surface_message, "The surface as triangles, for RViz; `surface_hz`."
    ),
    ContactArrowsSample: SampleTopic(
        "rpbi/{name}/contacts/arrows",
        MarkerArray,
        contact_arrows_message,
        "The forces as arrows, for RViz; `contacts.arrows_hz`.",
    ),
    ControllerState: SampleTopic(
        f"rpbi/{{name}}/{CONTROLLER}/state",
        JointTrajectoryControllerState,
        state_message,
        "Where joints are to be on the trajectory, and where they are; `state_publish_rate`.",
    ),
}
"""The topic of each type of samples that has topics of its own."""

_ELSEWHERE = (LinkPoseSample, SceneSample)
"""Samples that go to TF and to the renderer."""


def sample_topic(sensor: Sensor) -> SampleTopic | None:
    """Returns the topic of a sensor, None if its samples go elsewhere.

    Raises:
        ConfigError: If it comes from another package and has no topic that can be found.
    """
    if sensor.sample_type in _ELSEWHERE:
        return None
    if sensor.ros_topic:
        return find_topic(sensor.ros_topic, SampleTopic, sensor)
    if sensor.sample_type not in TOPICS:
        message = f"missing, expected 'module:NAME' of the SampleTopic for its {sensor.sample_type.__qualname__}"
        raise ConfigError([Problem(full_name(sensor), "ros_topic", message)])
    return TOPICS[sensor.sample_type]
