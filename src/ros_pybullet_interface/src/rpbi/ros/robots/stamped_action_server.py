"""An action server whose messages have the stamps of the world."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import rospy
from actionlib import ActionServer
from actionlib.server_goal_handle import ServerGoalHandle

from rpbi.engine.clock import Clock
from rpbi.ros.headers import to_ros_time
from rpbi.ros.publishers.topics import FastTopic


class StampedActionServer(ActionServer):
    """An action server for a node that does not use ROS time.

    actionlib takes all stamps and its timer from rospy, which in the simulator is the wall clock whatever
    `use_sim_time` says: right for the timer, not for the stamps. It also hands messages to threads that may lose the
    last ones when the server closes; here they leave at once.

    Args:
        name: Name of the action.
        action_type: Its ROS type.
        clock: The world's clock.
        take_goal: Takes the handle of a new goal; it must return at once.
        take_cancel: Takes the handle of a goal that is to be cancelled; it must return at once.
    """

    def __init__(
        self,
        name: str,
        action_type: type,
        clock: Clock,
        take_goal: Callable[[ServerGoalHandle], None],
        take_cancel: Callable[[ServerGoalHandle], None],
    ) -> None:
        super().__init__(name, action_type, take_goal, take_cancel, auto_start=False)
        self._clock = clock

    def initialize(self) -> None:
        """Opens the topics and starts the timer; called by `start`."""
        super().initialize()
        for key in ("status_pub", "result_pub", "feedback_pub"):
            publisher: rospy.Publisher = getattr(self, key)
            # Both are the same topic to rospy, so it must not end with the first one: who just comes would be lost.
            setattr(self, key, _StampedTopic(publisher.resolved_name, publisher.data_class, self._clock))
            publisher.unregister()


class _StampedTopic(FastTopic):
    """A topic with the stamps of the world, under the names by which actionlib uses it."""

    def __init__(self, topic: str, message_type: type, clock: Clock) -> None:
        super().__init__(topic, message_type)
        self._clock = clock

    def publish(self, message: Any) -> None:
        message.header.stamp = to_ros_time(self._clock.stamp_ns)
        super().publish(message)

    def unregister(self) -> None:
        self.close()
