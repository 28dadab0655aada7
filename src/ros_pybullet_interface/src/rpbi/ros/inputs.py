"""Receives the inputs of the world from topics and TF, and passes them to the world's mailbox."""

from collections.abc import Iterator, Mapping
from typing import Any

import geometry_msgs.msg
import rospy
from geometry_msgs.msg import PoseStamped, Vector3, WrenchStamped
from sensor_msgs.msg import JointState

from custom_ros_tools.errors import ConfigError, Problem
from custom_ros_tools.plugins import full_name
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning
from custom_ros_tools.ros.rospy_internals import close_poller_with
from rpbi.control.controllers.cartesian_impedance import PoseTarget
from rpbi.control.external_wrenches import TIMEOUT_S, ExternalWrench
from rpbi.control.joint_command import JointCommand, WrongQuantityError
from rpbi.control.motors import QUANTITIES, ResolvedCommand
from rpbi.control.planar_base import PlanarVelocity
from rpbi.engine.inputs import Input, PoseInput
from rpbi.geometry import Pose, Twist
from rpbi.world import World

from .endpoints import Topic, find_topic
from .headers import prefixed, to_ros_time, world_frame
from .tf_follower import TfFollower, refusal


def _joint_target(message: JointState) -> JointCommand:
    """Converts a message to a command; the robot's control mode selects which of the command's values are used."""
    return JointCommand(
        message.name, message.position, message.velocity, message.effort, message.header.stamp.to_nsec()
    )


def _twist(message: geometry_msgs.msg.Twist) -> Twist:
    linear, angular = message.linear, message.angular
    return Twist((linear.x, linear.y, linear.z), (angular.x, angular.y, angular.z))


def _external_wrench(message: WrenchStamped) -> ExternalWrench:
    """Converts a message to a wrench.

    If `frame_id` names a link, the wrench acts at the origin of the link, in the link's axes. If `frame_id` is empty or
    `world`, the wrench acts on the root link, in the world's axes.
    """
    frame = message.header.frame_id.removeprefix(prefixed("rpbi/"))
    in_link_axes = frame not in ("", "world")
    force, torque = message.wrench.force, message.wrench.torque
    return ExternalWrench(
        (force.x, force.y, force.z),
        (torque.x, torque.y, torque.z),
        link=frame if in_link_axes else "",
        in_link_axes=in_link_axes,
        duration_s=TIMEOUT_S,
    )


def _pose_target(message: PoseStamped) -> PoseTarget:
    position, quat = message.pose.position, message.pose.orientation
    frame = message.header.frame_id.lstrip("/")
    if frame not in ("", world_frame()):
        raise ValueError(f"expected a pose in '{world_frame()}', got one in '{frame}'")
    pose = Pose((position.x, position.y, position.z), (quat.x, quat.y, quat.z, quat.w))
    return PoseTarget(pose, message.header.stamp.to_nsec())


def _controller_target(message: JointState) -> JointCommand:
    stamp_ns = message.header.stamp.to_nsec()
    return JointCommand(tuple(message.name), tuple(message.position), (), tuple(message.effort), stamp_ns)


TOPIC_INPUTS: dict[str, Topic] = {
    "target": Topic(
        "rpbi/{name}/joint_states/target",
        JointState,
        _joint_target,
        "Targets: positions [rad or m], velocities or efforts by the control mode; joints not named keep theirs.",
    ),
    "cmd_vel": Topic(
        "rpbi/{name}/cmd_vel",
        geometry_msgs.msg.Twist,
        _twist,
        "Velocity of a planar base in its own frame [m/s, rad/s], for `cmd_vel_timeout_s`.",
    ),
    "external_wrench": Topic(
        "rpbi/{name}/external_wrench",
        WrenchStamped,
        _external_wrench,
        "Force [N] and torque [N m] on the link `frame_id`, in its axes, for 0.5 s; if it is empty, on the root link, "
        "in the world's axes.",
    ),
}
"""Topics of the inputs of bodies, indexed by the name of the input."""
POSE_TARGET = Topic(
    "rpbi/{name}/target", PoseStamped, _pose_target, "Target of the point that the controller holds, in the world."
)
JOINT_TARGET = Topic(
    "rpbi/{name}/target",
    JointState,
    _controller_target,
    "Targets of the controller's joints [rad or m]; efforts [N m or N], if any, are added.",
)


def topic_input(key: str, taken: Input) -> Topic:
    """Returns the topic of an input; `key` is the input's name.

    Raises:
        ConfigError: If another package defines the input and its `ros_topic` is missing or cannot be found.
    """
    if taken.ros_topic:
        return find_topic(taken.ros_topic, taken.apply)
    if key not in TOPIC_INPUTS:
        message = f"missing, expected 'module:NAME' of the Topic for its input '{key}'"
        raise ConfigError([Problem(full_name(taken.apply), "ros_topic", message)])
    return TOPIC_INPUTS[key]


def input_messages(world: World, slot: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Converts the value of an input to ROS messages, and yields pairs of a topic's name and a message.

    Only joint targets and base velocities are converted; for other inputs, there are no pairs.

    Args:
        world: The world. Messages of joint targets get the world's present stamp.
        slot: Body and name of the input, as `NAME/INPUT`.
        value: Value of the input, as it was applied to the world.
    """
    name, _, key = slot.rpartition("/")
    if key == "target" and isinstance(value, tuple):
        for command in (each for each in value if isinstance(each, ResolvedCommand)):
            yield TOPIC_INPUTS[key].name.format(name=name), _target_message(world, world.bodies[name], command)
    elif key == "cmd_vel" and isinstance(value, PlanarVelocity):
        linear, angular = Vector3(value.x, value.y, 0.0), Vector3(0.0, 0.0, value.yaw)
        yield TOPIC_INPUTS[key].name.format(name=name), geometry_msgs.msg.Twist(linear, angular)


def _target_message(world: World, robot: Any, command: ResolvedCommand) -> JointState:
    message = JointState(name=[robot.model.joints[index].name for index in command.values])
    message.header.stamp = to_ros_time(world.clock.stamp_ns)
    message.velocity = [command.velocities[index] for index in command.values if index in command.velocities]
    setattr(message, QUANTITIES[command.mode], list(command.values.values()))
    return message


class Inputs:
    """Subscribes to the inputs of the world; refused messages are logged at a limited rate.

    Args:
        world: The world; only its method `put` and the time of its clock are used.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._warn = ThrottledWarning()
        self._warn_seldom = ThrottledWarning(period_s=60.0)  # a controller for another mode may send continuously
        self._subscribers: dict[str, list[rospy.Subscriber]] = {}
        self._tf = TfFollower(world.put, lambda: world.clock.time_s)

    def open(self, name: str, inputs: Mapping[str, Input]) -> None:
        """Subscribes to the topics, and follows the TF frames, of the inputs of a body or sensor."""
        subscribers = self._subscribers.setdefault(name, [])
        for key, taken in inputs.items():
            if isinstance(taken, PoseInput):
                self._tf.follow(name, f"{name}/{key}", taken)
            else:
                subscribers.append(self._subscribe(name, key, taken))

    def close(self, name: str) -> None:
        """Unsubscribes from the topics, and stops following the TF frames, of a body or sensor."""
        for subscriber in self._subscribers.pop(name, []):
            subscriber.unregister()
        self._tf.leave(name)

    def repeat_poses(self) -> None:
        """Sends the last poses of all followed TF frames to the world again, for instance after a reset."""
        self._tf.repeat()

    def _subscribe(self, name: str, key: str, taken: Input) -> rospy.Subscriber:
        row = topic_input(key, taken)
        topic, slot, value = rospy.resolve_name(row.name.format(name=taken.owner or name)), f"{name}/{key}", row.handler
        assert value is not None  # rows of inputs have one

        def on_message(message: Any) -> None:
            try:
                self._world.put(slot, value(message))
            except WrongQuantityError as error:
                self._warn_seldom(topic, f"message refused: {error}")
            except Exception as error:
                self._warn(topic, f"message refused: {refusal(slot, taken, error)}")

        subscriber = rospy.Subscriber(topic, row.message_type, on_message, queue_size=100, tcp_nodelay=True)
        close_poller_with(subscriber)
        return subscriber
