"""Stamps for user input, and subscriptions that detect when the input ceases."""

import time
from collections.abc import Callable
from typing import Annotated, Any

import rospy
from pydantic import Field

from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning
from custom_ros_tools.schema import ConfigModel, Unit

SecondsOrOff = Annotated[float, Field(ge=0), Unit("s")]
"""Type of a time-out [s]; 0 means no time-out."""
QUEUE_SIZE = 10
"""Largest number of queued messages. Older input is useless, and dropped."""


def stamp() -> rospy.Time:
    """Returns the present ROS time, or wall time if simulated time has not started."""
    now = rospy.Time.now()
    return rospy.Time.from_sec(time.time()) if now.is_zero() else now


def has_begun() -> bool:
    """Returns whether ROS time has started.

    Transforms must not be sent earlier: with wall-time stamps, they would look newer than all later transforms.
    """
    return not rospy.Time.now().is_zero()


class InputParameters(ConfigModel):
    """Time without messages after which input counts as lost. Input without a publisher counts as lost, too."""

    input_timeout_s: SecondsOrOff = Field(
        0.0,
        description="Time without a message after which the input counts as lost; 0 waits forever, for devices that "
        "report only changes.",
    )


class WatchedInput:
    """Subscribes to a topic, and detects when its input has ceased.

    The input has ceased when the topic has no publisher any more, or no message has arrived within the timeout.

    Args:
        topic: Name of the topic.
        message_type: Message type of the topic.
        on_message: Function that is called with each message.
        timeout_s: The timeout [s]; 0 disables the timeout.
    """

    def __init__(
        self, topic: str, message_type: type, on_message: Callable[[Any], None], timeout_s: float = 0.0
    ) -> None:
        self._on_message, self._timeout_s = on_message, timeout_s
        self._last_s: float | None = None
        self._warn = ThrottledWarning()
        self._subscriber = rospy.Subscriber(topic, message_type, self._note, queue_size=QUEUE_SIZE, tcp_nodelay=True)

    @property
    def topic(self) -> str:
        """Full name of the topic."""
        return str(self._subscriber.resolved_name)

    def has_ceased(self, consequence: str) -> bool:
        """Returns whether the input has ceased. If it has, logs a warning that contains the text `consequence`.

        Returns False before the first message.
        """
        if self._last_s is None:
            return False
        if self._subscriber.get_num_connections() == 0:
            reason = "it has no publisher any more"
        elif self._timeout_s and time.monotonic() - self._last_s > self._timeout_s:
            reason = f"no message for {self._timeout_s:g} s"
        else:
            return False
        self._warn(self.topic, f"{reason}: {consequence}")
        return True

    def _note(self, message: Any) -> None:
        self._last_s = time.monotonic()
        self._on_message(message)
