"""Topics that setup nodes receive: start, previous solutions, and others that are checked in the same way."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from functools import partial

import rospy
from sensor_msgs.msg import JointState

from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning
from ik_ros.problem import JointPositions

from .messages import positions_in

QUEUE_SIZE = 10
START_TOPICS = ("qinit", "start_state", "currentPosition")
"""Names of solvers in the authors' release."""
PREVIOUS_TOPICS = ("previous_solutions", "previous_solution")


class ProblemInputs:
    """Start and previous solutions of the next problem, received by topics.

    Args:
        topics: Prefix of the topics.
        max_previous: Number of previous solutions that are kept.
        start: Start until one is received; None if the problem waits for it.

    Attributes:
        lock: Held while a message changes the next problem.
        start: Positions by joint [rad or m].
        previous: The same of previous solutions, the newest last.
    """

    def __init__(self, topics: str, max_previous: int, start: JointPositions | None) -> None:
        self.lock = threading.Lock()
        self.start = start
        self.previous: deque[JointPositions] = deque(maxlen=max_previous)
        self._topics, self._warn = topics, ThrottledWarning()

    def subscribe(self) -> None:
        """Receives starts and previous solutions from now on."""
        for topic in START_TOPICS:
            self.listen(topic, JointState, partial(self._on_start, topic))
        for topic in PREVIOUS_TOPICS:
            self.listen(topic, JointState, partial(self._on_previous, topic))

    def listen(self, topic: str, message_type: type, on_message: Callable[[rospy.Message], None]) -> None:
        """Calls a function with each message of a topic below the prefix; its ValueError is logged."""
        full_name = f"{self._topics}/{topic}"

        def checked(message: rospy.Message) -> None:
            try:
                with self.lock:
                    on_message(message)
            except ValueError as error:
                self._warn(rospy.resolve_name(full_name), f"message refused: {error}")

        rospy.Subscriber(full_name, message_type, checked, queue_size=QUEUE_SIZE, tcp_nodelay=True)

    def _on_start(self, topic: str, message: JointState) -> None:
        self.start = positions_in(topic, message)

    def _on_previous(self, topic: str, message: JointState) -> None:
        self.previous.append(positions_in(topic, message))
