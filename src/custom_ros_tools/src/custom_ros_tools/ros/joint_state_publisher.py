"""Publishes values of joints."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import rospy
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from ..joint_values import JointValues
from .joint_states import joint_state


class JointStatePublisher:
    """Publishes joint states of a fixed list of joints.

    Args:
        topic: The topic.
        joint_names: The n joints.
        queue_size: Messages kept for a slow subscriber.
    """

    def __init__(self, topic: str, joint_names: Sequence[str], queue_size: int = 1) -> None:
        self._names = tuple(joint_names)
        self._publisher = rospy.Publisher(topic, JointState, queue_size=queue_size)

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
        self._publisher.publish(joint_state(values, Header(stamp=rospy.Time.now())))
