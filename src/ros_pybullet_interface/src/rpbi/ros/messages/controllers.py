"""Targets and states of controllers that live in the tick as messages, and their topics."""

from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState

from ros_pybullet_interface.msg import ControllerState
from rpbi.control.controllers.cartesian_impedance import PoseTarget
from rpbi.control.controllers.manager import ControllerStateSample
from rpbi.control.joint_command import JointCommand
from rpbi.geometry import Pose
from rpbi.ros.endpoints import Topic
from rpbi.ros.headers import to_ros_time, world_frame


def controller_state_message(sample: ControllerStateSample, stamp_ns: int) -> ControllerState:
    """Returns the state of a controller as message."""
    message = ControllerState(
        name=sample.name.split("/", 1)[1],
        type=sample.type,
        active=sample.active,
        message=sample.message,
        value_names=list(sample.values),
        values=list(sample.values.values()),
    )
    message.header.stamp = to_ros_time(stamp_ns)
    return message


def _pose_target(message: PoseStamped) -> PoseTarget:
    position, quat = message.pose.position, message.pose.orientation
    frame = message.header.frame_id.lstrip("/")
    if frame not in ("", world_frame()):
        raise ValueError(f"expected a pose in '{world_frame()}', got one in '{frame}'")
    pose = Pose((position.x, position.y, position.z), (quat.x, quat.y, quat.z, quat.w))
    return PoseTarget(pose, message.header.stamp.to_nsec())


def _joint_target(message: JointState) -> JointCommand:
    stamp_ns = message.header.stamp.to_nsec()
    return JointCommand(tuple(message.name), tuple(message.position), (), tuple(message.effort), stamp_ns)


POSE_TARGET = Topic(
    "rpbi/{name}/target", PoseStamped, _pose_target, "Target of the point that the controller holds, in the world."
)
JOINT_TARGET = Topic(
    "rpbi/{name}/target",
    JointState,
    _joint_target,
    "Targets of the controller's joints [rad or m]; efforts [N m or N], if any, are added.",
)
