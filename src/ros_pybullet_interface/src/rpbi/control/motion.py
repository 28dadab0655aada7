"""Base class of motions. A motion drives some joints of a robot tick by tick until it succeeds or fails."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from concurrent.futures import Future
from typing import ClassVar, NamedTuple

JointMotion = Mapping[int, tuple[float, float]]
"""Position [rad or m] and velocity [rad/s or m/s] of joints, keyed by joint index."""


class MotionResult(NamedTuple):
    """Outcome of a motion.

    Attributes:
        success: Whether the motion reached its goal.
        message: Description of the outcome, with the reason.
    """

    success: bool
    message: str


class Motion(ABC):
    """Drives some joints of one robot. `JointDrive.run` starts a motion.

    The simulation thread makes all calls.

    Args:
        joints: Indices of the joints that the motion drives.

    Attributes:
        result: Future of the `MotionResult`. The future is set when the motion ends, for whatever reason.
    """

    can_wait: ClassVar[bool] = False
    """Whether the motion continues after the simulation was stopped and restarted; if not, a stop aborts the motion."""

    def __init__(self, joints: frozenset[int]) -> None:
        self.joints = joints
        self.result: Future[MotionResult] = Future()

    @property
    def is_over(self) -> bool:
        """Whether the motion has ended."""
        return self.result.done()

    @abstractmethod
    def begin(self, time_s: float, measured: JointMotion) -> None:
        """Starts the motion.

        Args:
            time_s: The world's present time [s].
            measured: Measured state of all driven joints of the robot.
        """

    @abstractmethod
    def advance(self, time_s: float, measured: JointMotion) -> JointMotion:
        """Computes the set points for one tick. An implementation calls `end` when the motion is complete or fails.

        Args:
            time_s: The world's time [s] at the end of the tick.
            measured: Measured state of all driven joints at the beginning of the tick.

        Returns:
            Set points of `joints` or a subset; missing joints keep their set points. The position is the desired one at
            the beginning of the tick. The velocity leads to the desired position at the end (see `Motors.track`).
        """

    def halt(self, reason: str, measured: JointMotion) -> None:
        """Ends the motion before its goal, as a failure.

        Args:
            reason: External cause, such as `the simulation was stopped`.
            measured: Measured state of all driven joints.
        """
        self.end(False, reason)

    def end(self, success: bool, message: str) -> None:
        """Ends the motion with a result, unless the motion has ended already."""
        if not self.is_over:
            self.result.set_result(MotionResult(success, message))
