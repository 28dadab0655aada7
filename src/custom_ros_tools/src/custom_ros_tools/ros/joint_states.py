"""Reorders, publishes and receives joint state messages."""

from collections.abc import Callable, Iterable, Sequence

import numpy as np
import rospy
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.joint_values import JointValues
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning
from custom_ros_tools.transforms import Array


def values_in(message: JointState) -> JointValues:
    """Converts a message to checked values.

    Raises:
        ValueError: If lists differ in length, a joint name is repeated, or a value is not finite.
    """
    return JointValues.of(message.name, message.position, message.velocity, message.effort)


def joint_state(values: JointValues, header: Header) -> JointState:
    """Converts values to a message."""
    return JointState(
        header=header,
        name=list(values.names),
        position=list(values.position),
        velocity=list(values.velocity),
        effort=list(values.effort),
    )


def resolve_joint_order(msg: JointState, joint_names: Sequence[str], ns: str = "") -> JointState:
    """Selects joints from a joint state, in a given order. Quantities that the message lacks stay empty.

    Args:
        msg: The joint state, with joints in any order; may contain additional joints.
        joint_names: Names of the joints in the result.
        ns: Prefix of the names in `msg`: joint `a` is called `ns/a`. By default, names have no prefix.

    Raises:
        MissingJointsError: If joints are missing; the error names all missing joints.
        ValueError: If lists in `msg` differ in length, a joint name is repeated, or a value is not finite.
    """
    return joint_state(values_in(msg).in_order(joint_names, ns), msg.header)


def get_joint_state(
    topic: str = "joint_states",
    timeout: float | None = None,
    joint_names: Sequence[str] | None = None,
    ns: str = "",
) -> JointState:
    """Waits for one joint state on a topic, and returns the message.

    Args:
        topic: Name of the topic.
        timeout: Longest time to wait, in wall time [s]; None waits without limit.
        joint_names: Names and order of the joints in the result; None returns the message unchanged.
        ns: Prefix of the names in the message, as for `resolve_joint_order`.

    Raises:
        rospy.ROSException: If no message arrives in time.
        MissingJointsError: If the message lacks joints.
        ValueError: If the message is invalid.
    """
    message = rospy.wait_for_message(topic, JointState, timeout)
    return message if joint_names is None else resolve_joint_order(message, joint_names, ns)


class JointStatePublisher(rospy.Publisher):
    """Publishes joint states of a fixed list of joints.

    Args:
        topic_name: Name of the topic.
        joint_names: Names of the n joints.
        queue_size: Largest number of messages that are buffered for a slow subscriber.
    """

    def __init__(self, topic_name: str, joint_names: Sequence[str], queue_size: int = 1) -> None:
        self._names = tuple(joint_names)
        super().__init__(topic_name, JointState, queue_size=queue_size)

    def publish(
        self,
        q: Iterable[float] | None = None,
        qd: Iterable[float] | None = None,
        eff: Iterable[float] | None = None,
    ) -> None:
        """Publishes a joint state with the current time as stamp. Quantities that are not given stay empty.

        Args:
            q: n positions [rad or m].
            qd: n velocities [rad/s or m/s].
            eff: n torques or forces [N m or N].

        Raises:
            ValueError: If a quantity does not have n values, or a value is not finite.
        """
        values = JointValues.of(self._names, q, qd, eff)
        super().publish(joint_state(values, Header(stamp=rospy.Time.now())))


QUEUE_SIZE = 1000
"""Queue size for subscribers with a callback, so that messages are not lost on a busy machine."""


class JointStateSubscriber(rospy.Subscriber):
    """Stores the newest joint state of a topic, with joints in a given order.

    Messages that are invalid or lack joints are ignored, with a throttled warning. The previous message is then kept.

    Args:
        topic_name: Name of the topic.
        joint_names: Names of the n joints, in the desired order.
        ns: Prefix of the names in messages: joint `a` is called `ns/a`. By default, names have no prefix.
        callback: Function that is called with each reordered joint state. Up to 1,000 messages wait in a queue.
    """

    def __init__(
        self,
        topic_name: str,
        joint_names: Sequence[str],
        ns: str = "",
        callback: Callable[[JointState], None] | None = None,
    ) -> None:
        self._names, self._ns, self._callback = tuple(joint_names), ns, callback
        self._topic, self._warn = rospy.resolve_name(topic_name), ThrottledWarning()
        self._newest: JointState | None = None
        queue_size = 1 if callback is None else QUEUE_SIZE
        super().__init__(self._topic, JointState, self._on_message, queue_size=queue_size, tcp_nodelay=True)

    def received(self) -> bool:
        """Returns whether a valid joint state has arrived."""
        return self._newest is not None

    recieved = received  # misspelt in the original package

    def get(self) -> JointState | None:
        """Returns the newest joint state; None before the first message."""
        return self._newest

    def get_position(self) -> Array | None:
        """Returns n positions [rad or m]; empty if the message lacks positions, None before the first message."""
        return self._values("position")

    def get_velocity(self) -> Array | None:
        """Returns n velocities [rad/s or m/s]; empty if the message lacks velocities, None before the first message."""
        return self._values("velocity")

    def get_effort(self) -> Array | None:
        """Returns n efforts [N m or N]; empty if the message lacks efforts, None before the first message."""
        return self._values("effort")

    def _values(self, quantity: str) -> Array | None:
        newest = self._newest
        return None if newest is None else np.array(getattr(newest, quantity), dtype=float)

    def _on_message(self, message: JointState) -> None:
        try:
            ordered = resolve_joint_order(message, self._names, self._ns)
        except (InterfaceError, ValueError) as error:
            self._warn(self._topic, f"message refused: {error}")
            return
        self._newest = ordered
        if self._callback is not None:
            self._callback(ordered)
