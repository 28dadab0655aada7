"""What the nodes that remap joint states have in common."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import rospy
from sensor_msgs.msg import JointState

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.throttle import ThrottledWarning
from custom_ros_tools.ros.services import ToggleService
from custom_ros_tools.toggle import Toggle

QUEUE_SIZE = 100
"""Messages kept while the machine is busy: 0.1 s of joint states at 1 kHz."""


class RemapNode:
    """Publishes what it makes of joint states while it is switched on; off, it does not even listen.

    It has the service `remap_joint_state/toggle` and the same under the name of its executable.

    Args:
        executable: The name of the executable.
        source: Topic of the joint states.
        target: Topic of what is made of them.
        target_type: The ROS type of that.
        convert: Makes it; raises InterfaceError or ValueError for a message that must be refused.
        start_on_init: Whether it is on from the start.
    """

    def __init__(
        self,
        executable: str,
        source: str,
        target: str,
        target_type: type,
        convert: Callable[[JointState], Any],
        start_on_init: bool,
    ) -> None:
        self._source, self._convert = rospy.resolve_name(source), convert
        self._warn = ThrottledWarning()
        self._publisher = rospy.Publisher(target, target_type, queue_size=QUEUE_SIZE, tcp_nodelay=True)
        self._subscriber: rospy.Subscriber | None = None
        remapping = Toggle("remapping", self._listen, self._listen_no_more)
        if start_on_init:
            remapping.on()
        for name in {"remap_joint_state/toggle", f"{executable}/toggle"}:
            ToggleService(name, remapping.on, remapping.off)

    def _listen(self) -> None:
        self._subscriber = rospy.Subscriber(
            self._source, JointState, self._take, queue_size=QUEUE_SIZE, tcp_nodelay=True
        )

    def _listen_no_more(self) -> None:
        if self._subscriber is not None:
            self._subscriber.unregister()

    def _take(self, message: JointState) -> None:
        try:
            converted = self._convert(message)
        except (InterfaceError, ValueError) as error:
            self._warn(self._source, f"message refused: {error}")
            return
        self._publisher.publish(converted)
