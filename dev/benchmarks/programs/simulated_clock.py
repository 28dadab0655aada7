"""ROS time that jumps and stops."""

from __future__ import annotations

import threading
import time

import rospy
from rosgraph_msgs.msg import Clock


class SimulatedClock:
    """Publishes `/clock`, 500 times a second."""

    def __init__(self) -> None:
        self._publisher = rospy.Publisher("/clock", Clock, queue_size=10, tcp_nodelay=True)
        self._offset_s = 0.0
        self._stands_at_s: float | None = None
        threading.Thread(target=self._run, daemon=True).start()

    def jump(self, by_s: float) -> None:
        """Shifts the clock forward [s]."""
        self._offset_s += by_s

    def stand_still(self, at_s: float | None = None) -> None:
        """Stops at the present or at a given time [s]."""
        self._stands_at_s = time.time() + self._offset_s if at_s is None else at_s

    def go_on(self) -> None:
        """Continues after a stop."""
        self._stands_at_s = None

    def _run(self) -> None:
        while not rospy.is_shutdown():
            now_s = time.time() + self._offset_s if self._stands_at_s is None else self._stands_at_s
            self._publisher.publish(Clock(rospy.Time.from_sec(now_s)))
            time.sleep(0.002)
