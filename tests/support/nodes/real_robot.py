"""The stand-in for a real robot that examples with `real_robot:=true` lead."""

from __future__ import annotations

import numpy as np
from ros_system import RosSystem, wait_until
from sensor_msgs.msg import JointState

from rpbi_utils.msg import DriverState

MOVED_RAD = 0.05
SLOW_S = 120.0


class RealRobot:
    """Listens to the stand-in; made before the example is launched.

    Args:
        ros: Who listens.
    """

    def __init__(self, ros: RosSystem) -> None:
        self._states = ros.listen("/stand_in/driver_state", DriverState)
        self._joints = ros.listen("/rpbi/real/joint_states/target", JointState)

    @property
    def has_moved(self) -> bool:
        """Whether a joint is some way from where the first target was."""
        messages = self._joints.messages
        return bool(messages) and np.abs(np.subtract(messages[-1].position, messages[0].position)).max() > MOVED_RAD

    @property
    def has_followed(self) -> bool:
        """Whether the driver was in motion until its last message, without a reflex."""
        state = self._states.messages[-1]
        return bool(state.mode == DriverState.MOVE and state.reflexes == 0)

    def wait_until_moved(self) -> None:
        """Waits until a joint has gone some way; its driver must be in motion then, without a reflex."""
        wait_until(lambda: self.has_moved, "the real robot has moved", SLOW_S)
        assert self.has_followed, self._states.messages[-1].message
