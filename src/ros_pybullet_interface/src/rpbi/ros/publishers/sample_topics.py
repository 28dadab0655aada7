"""Topics of the sensors' samples, and functions that convert samples to messages."""

from collections.abc import Sequence
from typing import Any

import genpy
from apriltag_ros.msg import AprilTagDetection, AprilTagDetectionArray
from control_msgs.msg import JointTrajectoryControllerState
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseWithCovariance,
    PoseWithCovarianceStamped,
    Quaternion,
    Transform,
    TransformStamped,
    Twist,
    Vector3,
    Wrench,
    WrenchStamped,
)
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from std_msgs.msg import ColorRGBA, Header
from trajectory_msgs.msg import JointTrajectoryPoint
from visualization_msgs.msg import Marker, MarkerArray

from custom_ros_tools.errors import ConfigError, Problem
from custom_ros_tools.plugins import full_name
from ros_pybullet_interface.msg import ContactPoint, Contacts
from ros_pybullet_interface.msg import ControllerState as ControllerStateMessage
from rpbi.control.controllers.manager import ControllerStateSample
from rpbi.control.trajectories.trajectory import TrajectoryStateSample
from rpbi.ros.endpoints import Topic, find_topic
from rpbi.ros.headers import named_frame, prefixed, stamped_header, to_ros_time, world_frame
from rpbi.samples import (
    AprilTagsSample,
    BaseStateSample,
    ContactArrowsSample,
    ContactsSample,
    JointStateSample,
    LinkPoseSample,
    SurfaceSample,
    ViconSample,
    WrenchSample,
)
from rpbi.sensors import SENSOR_TYPES, Sensor

from .packed_messages import PackedJointState

CONTROLLER = "joint_trajectory_controller"
"""Namespace of a robot's trajectory follower below `rpbi/NAME/`."""
_ARROW = Vector3(0.015, 0.03, 0.04)
"""Diameter of the shaft, diameter of the head and length of the head of an arrow [m]."""
_COLOUR = ColorRGBA(0.85, 0.1, 0.1, 1.0)


def joint_state_message(sample: JointStateSample, stamp_ns: int) -> JointState:
    """Converts a sample with positions, velocities and efforts of all joints to a message."""
    header = stamped_header(stamp_ns, "")
    return PackedJointState(header, sample.joint_names, sample.position, sample.velocity, sample.effort)


def wrench_message(sample: WrenchSample, stamp_ns: int) -> WrenchStamped:
    """Converts a sample with force and moment to a message; only frames whose name starts with `rpbi/` get a prefix."""
    message = WrenchStamped(wrench=Wrench(Vector3(*sample.force), Vector3(*sample.torque)))
    is_ours = sample.frame_id.startswith("rpbi/")
    message.header.frame_id = prefixed(sample.frame_id) if is_ours else sample.frame_id
    message.header.stamp = to_ros_time(stamp_ns)
    return message


def contacts_message(sample: ContactsSample, stamp_ns: int) -> Contacts:
    """Converts a sample with a body's contact points and forces to a message."""
    points = [
        ContactPoint(
            link=point.link,
            other_body=point.other_body,
            other_link=point.other_link,
            position=Point(*point.position),
            normal=Vector3(*point.normal),
            depth=point.depth,
            normal_force=point.normal_force,
            friction_direction_1=Vector3(*point.friction_directions[0]),
            friction_force_1=point.friction_forces[0],
            friction_direction_2=Vector3(*point.friction_directions[1]),
            friction_force_2=point.friction_forces[1],
        )
        for point in sample.points
    ]
    return Contacts(_header(stamp_ns), Vector3(*sample.force), points)


def contact_arrows_message(sample: ContactArrowsSample, stamp_ns: int) -> MarkerArray:
    """Converts a sample with arrows to markers that replace the previous arrows."""
    header = _header(stamp_ns)
    markers = [Marker(header=header, action=Marker.DELETEALL)]
    for number, (start, end) in enumerate(sample.arrows):
        marker = Marker(header=header, ns=sample.name, id=number, type=Marker.ARROW, action=Marker.ADD)
        marker.points = [Point(*start), Point(*end)]
        marker.scale, marker.color = _ARROW, _COLOUR
        marker.pose.orientation.w = 1.0
        markers.append(marker)
    return MarkerArray(markers)


def odometry_message(sample: BaseStateSample, stamp_ns: int) -> Odometry:
    """Converts a sample with a base's pose and twist to a message; covariances are zero, since the sample is exact."""
    message = Odometry(header=_header(stamp_ns), child_frame_id=prefixed(sample.frame))
    message.pose.pose.position = Point(*sample.pose.position)
    message.pose.pose.orientation = Quaternion(*sample.pose.quat_xyzw)
    message.twist.twist = Twist(Vector3(*sample.twist.linear), Vector3(*sample.twist.angular))
    return message


def surface_message(sample: SurfaceSample, stamp_ns: int) -> Marker:
    """Converts a sample with a surface to a marker of triangles in the world frame."""
    marker = Marker(ns=sample.name, type=Marker.TRIANGLE_LIST, action=Marker.ADD, scale=Vector3(1.0, 1.0, 1.0))
    marker.header = _header(stamp_ns)
    marker.pose.orientation.w = 1.0
    marker.color = ColorRGBA(*sample.rgba)
    marker.points = [Point(*corner) for corner in sample.corners]
    return marker


def controller_state_message(sample: ControllerStateSample, stamp_ns: int) -> ControllerStateMessage:
    """Converts a sample with a controller's state to a message."""
    message = ControllerStateMessage(
        name=sample.name.split("/", 1)[1],
        type=sample.type,
        active=sample.active,
        message=sample.message,
        value_names=list(sample.values),
        values=list(sample.values.values()),
    )
    message.header.stamp = to_ros_time(stamp_ns)
    return message


def state_message(state: TrajectoryStateSample, stamp_ns: int) -> JointTrajectoryControllerState:
    """Converts a sample with a trajectory follower's state to a message."""
    return fill_state(JointTrajectoryControllerState(), state, stamp_ns)


def fill_state(message: Any, state: TrajectoryStateSample, stamp_ns: int) -> Any:
    """Fills the fields of a message with a trajectory follower's state, and returns the message.

    The message is a JointTrajectoryControllerState, or the feedback of the trajectory action.
    """
    desired = state.desired
    since_start = genpy.Duration.from_sec(state.time_from_start_s)
    message.header.stamp = to_ros_time(stamp_ns)
    message.joint_names = state.joint_names
    message.desired = JointTrajectoryPoint(desired.position, desired.velocity, desired.acceleration, (), since_start)
    message.actual = JointTrajectoryPoint(state.position, state.velocity, (), (), since_start)
    off = _difference(desired.position, state.position), _difference(desired.velocity, state.velocity)
    message.error = JointTrajectoryPoint(*off, (), (), since_start)
    return message


def _vicon_message(sample: ViconSample, stamp_ns: int) -> TransformStamped:
    header = Header(stamp=to_ros_time(stamp_ns - sample.age_ns), frame_id=world_frame())
    transform = Transform(Vector3(*sample.pose.position), Quaternion(*sample.pose.quat_xyzw))
    return TransformStamped(header, prefixed(sample.frame), transform)


def _detections_message(sample: AprilTagsSample, stamp_ns: int) -> AprilTagDetectionArray:
    header = Header(stamp=to_ros_time(stamp_ns - sample.age_ns), frame_id=named_frame(sample.frame))
    message = AprilTagDetectionArray(header=header)
    for tag in sample.tags:
        pose = PoseWithCovariance(pose=Pose(Point(*tag.pose.position), Quaternion(*tag.pose.quat_xyzw)))
        message.detections.append(AprilTagDetection([tag.id], [tag.size], PoseWithCovarianceStamped(header, pose)))
    return message


def _vicon_on_tf(sample: ViconSample, stamp_ns: int) -> tuple[LinkPoseSample, int]:
    return LinkPoseSample(sample.name, (sample.frame,), (sample.pose,)), stamp_ns - sample.age_ns


def _difference(a: Sequence[float], b: Sequence[float]) -> list[float]:
    return [x - y for x, y in zip(a, b, strict=True)]


def _header(stamp_ns: int) -> Header:
    return stamped_header(stamp_ns, world_frame())


CONTROLLER_STATE = Topic(
    "rpbi/{name}/state",
    ControllerStateMessage,
    controller_state_message,
    "Whether the controller drives its joints, and its own numbers; `state_hz` of the controller.",
)
WRENCH = Topic(
    "rpbi/{name}/ft_sensor",
    WrenchStamped,
    wrench_message,
    "Force [N] and moment [N m] in the joint, in the frame of its child link; "
    "`hz` of `enabled_joint_force_torque_sensors`.",
)
JOINT_STATES = Topic(
    "rpbi/{name}/joint_states",
    JointState,
    joint_state_message,
    "Position [rad or m], velocity and the motor's effort [N m or N] of all joints, fixed ones too, in the URDF's "
    "order; `joint_state_publisher_hz`.",
)
BASE_STATE = Topic(
    "rpbi/{name}/base_state",
    Odometry,
    odometry_message,
    "Pose of the root link in the world [m], its velocity in its own axes [m/s, rad/s]; `base_state_hz`.",
)
CONTACTS = Topic(
    "rpbi/{name}/contacts",
    Contacts,
    contacts_message,
    "Where others touch the body, and their forces on it [N]; `contacts.hz`.",
)
SURFACE = Topic("rpbi/{name}/surface", Marker, surface_message, "The surface as triangles, for RViz; `surface_hz`.")
CONTACT_ARROWS = Topic(
    "rpbi/{name}/contacts/arrows",
    MarkerArray,
    contact_arrows_message,
    "The forces as arrows, for RViz; `contacts.arrows_hz`.",
)
TRAJECTORY_STATE = Topic(
    f"rpbi/{{name}}/{CONTROLLER}/state",
    JointTrajectoryControllerState,
    state_message,
    "Desired and measured states of the joints on the trajectory; `state_publish_rate`.",
)
VICON = Topic(
    "vicon/{name}",
    TransformStamped,
    _vicon_message,
    "Pose of a link in the world [m] as vicon_bridge reports it, on TF too; `hz` of a sensor `vicon`.",
    on_tf=_vicon_on_tf,
)
APRIL_TAGS = Topic(
    "tag_detections",
    AprilTagDetectionArray,
    _detections_message,
    "Tags that a camera sees, in its optical frame [m], as apriltag_ros reports them; `hz` of a sensor `april_tags`.",
)


def address(sensor: Sensor) -> str:
    """Returns the name by which requests address a sensor.

    The name is the sensor's topic without `rpbi/`, `NAME/tf` for a sensor that only publishes on TF, and the camera's
    name for a camera.
    """
    topic = sample_topic(sensor)
    if topic is not None:
        return topic.name.format(name=sensor.name).removeprefix("rpbi/")
    return f"{sensor.name}/tf" if sensor.sample_type is LinkPoseSample else sensor.name


def sample_topic(sensor: Sensor) -> Topic | None:
    """Returns the topic of a sensor; None if the sensor's samples do not have their own topic.

    Raises:
        ConfigError: If another package defines the sensor, and its `ros_topic` is missing or cannot be found.
    """
    place = sensor.ros_topic
    if place == "":
        place = next((each.ros_topic for each in SENSOR_TYPES.values() if each.sample_type is sensor.sample_type), "")
    if place is None:
        return None
    if not place:
        message = f"missing, expected 'module:NAME' of the Topic for its {sensor.sample_type.__qualname__}"
        raise ConfigError([Problem(full_name(sensor), "ros_topic", message)])
    found = find_topic(place, sensor)
    return found if sensor.topic is None else found._replace(name=sensor.topic)
