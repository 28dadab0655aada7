"""Keeps the newest values of joints."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import rospy
from sensor_msgs.msg import JointState

from ..errors import InterfaceError
from ..transforms import Array
from .joint_states import resolve_joint_order
from .throttle import ThrottledWarning


class JointStateSubscriber:
    """Keeps the newest joint state of a topic, its joints in the order of a list.

    Messages that lack joints or are faulty are refused and named now and then; the one before stays.

    Args:
        topic: The topic.
        joint_names: The n joints.
        ns: What their names in messages begin with, as `ns` in `ns/joint`.
        callback: Called with each joint state, its joints in order.
    """

    def __init__(
        self,
        topic: str,
        joint_names: Sequence[str],
        ns: str = "",
        callback: Callable[[JointState], None] | None = None,
    ) -> None:
        self._names, self._ns, self._callback = tuple(joint_names), ns, callback
        self._topic, self._warn = rospy.resolve_name(topic), ThrottledWarning()
        self._newest: JointState | None = None
        self._subscriber = rospy.Subscriber(self._topic, JointState, self._take, queue_size=1, tcp_nodelay=True)

    def received(self) -> bool:
        """Tells whether there is a joint state."""
        return self._newest is not None

    recieved = received  # as the release spells it

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

    def _take(self, message: JointState) -> None:
        try:
            ordered = resolve_joint_order(message, self._names, self._ns)
        except (InterfaceError, ValueError) as error:
            self._warn(self._topic, f"message refused: {error}")
            return
        self._newest = ordered
        if self._callback is not None:
            self._callback(ordered)
