"""Topics that a body listens to beside the inputs of the world."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import rospy
from trajectory_msgs.msg import JointTrajectory

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.throttle import ThrottledWarning
from ros_pybullet_interface.msg import CalculateInverseKinematicsProblem
from rpbi.bodies import Body
from rpbi.ros.robots.ik import ik_topic_suffixes, move_by_ik
from rpbi.ros.robots.trajectory_commands import follow_command, of_followers

from .body_context import BodyContext


class BodyTopic(NamedTuple):
    """A topic that bodies of some types listen to.

    Attributes:
        message_type: Its ROS type.
        take: Acts on a message; it raises InterfaceError or ValueError for one that must be refused.
        suffixes: What follows `rpbi/NAME/` in its names, for a body; nothing if the body does not have it.
        meaning: What a message does, in a sentence.
    """

    message_type: type
    take: Callable[[BodyContext, Any], None]
    suffixes: Callable[[Body], Sequence[str]]
    meaning: str


BODY_TOPICS: tuple[BodyTopic, ...] = (
    BodyTopic(
        CalculateInverseKinematicsProblem,
        move_by_ik,
        ik_topic_suffixes,
        "The robot goes to the solution of the problem; with `start_ik_callback`.",
    ),
    BodyTopic(
        JointTrajectory,
        follow_command,
        of_followers("command"),
        "The robot follows the trajectory, without looking at how well.",
    ),
)

_warn = ThrottledWarning()


def open_topic(body_topic: BodyTopic, context: BodyContext) -> rospy.Subscriber:
    """Subscribes to one topic of a body; what is refused is named now and then."""
    topic = rospy.resolve_name(f"rpbi/{context.body.name}/{context.suffix}")

    def take(message: Any) -> None:
        try:
            body_topic.take(context, message)
        except (InterfaceError, ValueError) as error:
            _warn(topic, f"message refused: {error}")

    return rospy.Subscriber(topic, body_topic.message_type, take, queue_size=1, tcp_nodelay=True)
