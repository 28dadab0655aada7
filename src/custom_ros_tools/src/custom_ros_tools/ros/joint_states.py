"""Joint states as messages: reordered, published, stored."""

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
    """Returns a joint state with its joints in the requested order; velocities or efforts that it lacks stay empty.

    Args:
        msg: The joint state, in any order, perhaps with more joints.
        joint_names: The requested joints, under which the result lists them.
        ns: Prefix of their names in `msg`, as `ns` in `ns/joint`; empty for none.

    Raises:
        MissingJointsError: If joints are missing; it names all of them.
        ValueError: If lengths in `msg` differ, a joint is named twice or a value is not finite.
    """
    return joint_state(values_in(msg).in_order(joint_names, ns), msg.header)


def get_joint_state(
    topic: str = "joint_states",
    timeout: float | None = None,
    joint_names: Sequence[str] | None = None,
    ns: str = "",
) -> JointState:
    """Waits for one message of a topic and returns it.

    Args:
        timeout: Longest time to wait [s] of wall time; None waits forever.
        joint_names: The requested joints; None returns all in the order received.
        ns: As for `resolve_joint_order`.

    Raises:
        rospy.ROSException: If none arrived in time.
        MissingJointsError: If the message lacks joints.
        ValueError: If the message is invalid.
    """
    message = rospy.wait_for_message(topic, JointState, timeout)
    return message if joint_names is None else resolve_joint_order(message, joint_names, ns)


class JointStatePublisher(rospy.Publisher):
    """Publishes joint states of a fixed list of joints.

    Args:
        joint_names: The n joints.
        queue_size: Number of messages that are buffered for a slow subscriber.
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
        """Publishes values with the present stamp.

        Args:
            q: n positions [rad or m].
            qd: n velocities [rad/s or m/s].
            eff: n torques or forces [N m or N].

        Raises:
            ValueError: If there are more or fewer than n, or a value is not finite.
        """
        values = JointValues.of(self._names, q, qd, eff)
        super().publish(joint_state(values, Header(stamp=rospy.Time.now())))


QUEUE_SIZE = 1000
"""Messages that wait for a callback which needs each of them."""


class JointStateSubscriber(rospy.Subscriber):
    """Stores the newest joint state of a topic, its joints in the order of a list.

    Messages that lack joints or are invalid are refused with a throttled warning; the previous one stays.

    Args:
        joint_names: The n joints.
        ns: Prefix of their names in messages, as `ns` in `ns/joint`.
        callback: Called with each joint state, its joints in order; on a busy machine up to 1,000 wait for it.
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
        """Returns whether there is a joint state."""
        return self._newest is not None

    recieved = received  # spelled as in the authors' release

    def get(self) -> JointState | None:
        """Returns the newest joint state, None if there is none yet."""
        return self._newest

    def get_position(self) -> Array | None:
        """Returns n positions [rad or m]; none if the message has none, None if there is no message yet."""
        return self._values("position")

    def get_velocity(self) -> Array | None:
        """Returns n velocities [rad/s or m/s]; none if the message has none, None if there is no message yet."""
        return self._values("velocity")

    def get_effort(self) -> Array | None:
        """Returns n efforts [N m or N]; none if the message has none, None if there is no message yet."""
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
