"""A transform that is told again and again."""

from __future__ import annotations

import rospy
from geometry_msgs.msg import Transform, TransformStamped
from tf2_msgs.msg import TFMessage


class TransformTopic:
    """Sends one transform to /tf with the present stamp; nothing while that and the transform stay the same.

    While simulated time stands still, the same stamp again would make each listener warn of a repeated one. Who comes
    then gets the last one all the same, since the topic is latched.

    Args:
        parent: The parent frame.
        child: The child frame.
    """

    def __init__(self, parent: str, child: str) -> None:
        self._parent, self._child = parent, child
        self._last: TransformStamped | None = None
        self._publisher = rospy.Publisher("/tf", TFMessage, latch=True, queue_size=10)

    def send(self, transform: Transform) -> None:
        """Sends the pose of the child in the parent, as it is now."""
        message = TransformStamped(child_frame_id=self._child, transform=transform)
        message.header.frame_id = self._parent
        message.header.stamp = rospy.Time.now()
        if message != self._last:
            self._last = message
            self._publisher.publish(TFMessage([message]))
