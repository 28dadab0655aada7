"""Joint states as messages, in the order that is asked for."""

from __future__ import annotations

from collections.abc import Sequence

import rospy
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from ..joint_values import JointValues


def values_in(message: JointState) -> JointValues:
    """Returns the values in a message.

    Raises:
        ValueError: If lengths differ, a joint is named twice or a value is not finite.
    """
    return JointValues.of(message.name, message.position, message.velocity, message.effort)


def joint_state(values: JointValues, header: Header) -> JointState:
    """Returns a message."""
    return JointState(
        header=header,
        name=list(values.names),
        position=list(values.position),
        velocity=list(values.velocity),
        effort=list(values.effort),
    )


def resolve_joint_order(msg: JointState, joint_names: Sequence[str], ns: str = "") -> JointState:
    """Returns a joint state with its joints in the order asked for; velocities or efforts it lacks stay empty.

    Args:
        msg: The joint state, in any order, perhaps with more joints.
        joint_names: The joints asked for, which the result names like this.
        ns: What their names in `msg` begin with, as `ns` in `ns/joint`; empty if they begin with nothing.

    Raises:
        MissingJointsError: If joints are missing; it names all of them.
        ValueError: If lengths in `msg` differ, a joint is named twice or a value is not finite.
    """
    return joint_state(values_in(msg).in_order(joint_names, ns), msg.header)


def get_joint_state(
    topic: str, timeout: float | None = None, joint_names: Sequence[str] | None = None, ns: str = ""
) -> JointState:
    """Waits for one message of a topic and returns it.

    Args:
        topic: The topic.
        timeout: How long to wait [s] of wall time; None is for ever.
        joint_names: The joints asked for; None takes all as they come.
        ns: As for `resolve_joint_order`.

    Raises:
        rospy.ROSException: If none came in time.
        MissingJointsError: If the message lacks joints.
        ValueError: If the message is faulty.
    """
    message = rospy.wait_for_message(topic, JointState, timeout)
    return message if joint_names is None else resolve_joint_order(message, joint_names, ns)
