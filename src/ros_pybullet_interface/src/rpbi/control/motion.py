"""Motions, which drive some joints of a robot tick by tick until they end."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from concurrent.futures import Future
from typing import ClassVar, NamedTuple

JointMotion = Mapping[int, tuple[float, float]]
"""Position [rad or m] and velocity [rad/s or m/s] by joint index."""


class MotionResult(NamedTuple):
    """Outcome of a motion.

    Attributes:
        success: Whether it reached its goal.
        message: Description of the outcome, with the reason.
    """

    success: bool
    message: str


class Motion(ABC):
    """Drives some joints of one robot; `JointDrive.run` starts it, on the simulation thread, which makes all calls.

    Args:
        joints: Indices of the joints that it drives.

    Attributes:
        result: Future of the outcome, set when the motion ends for any reason.
    """

    can_wait: ClassVar[bool] = False
    """Whether it continues after the world was stopped; others are aborted by a stop."""

    def __init__(self, joints: frozenset[int]) -> None:
        self.joints = joints
        self.result: Future[MotionResult] = Future()

    @property
    def is_over(self) -> bool:
        """Whether it has ended."""
        return self.result.done()

    @abstractmethod
    def begin(self, time_s: float, measured: JointMotion) -> None:
        """Starts at the world's time now [s], from the state of all driven joints of the robot."""

    @abstractmethod
    def advance(self, time_s: float, measured: JointMotion) -> JointMotion:
        """Returns the set points for one tick; a motion that has reached its end calls `end` in it.

        Args:
            time_s: The world's time at the end of that tick [s].
            measured: State of all driven joints at its beginning.

        Returns:
            Set points of `joints`, or of fewer: the others keep theirs. They are the positions at the beginning of the
            tick, and the velocities that lead to the positions at its end (see `Motors.track`).
        """

    def halt(self, reason: str, measured: JointMotion) -> None:
        """Ends before the goal for a reason from outside, such as `the simulation was stopped`."""
        self.end(False, reason)

    def end(self, success: bool, message: str) -> None:
        """Ends, unless it has ended already."""
        if not self.is_over:
            self.result.set_result(MotionResult(success, message))
