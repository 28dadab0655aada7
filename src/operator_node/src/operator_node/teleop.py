"""Moves a frame within a box-shaped workspace, as commanded by a user's velocity signals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, NamedTuple

from pydantic import Field, model_validator

from custom_ros_tools.schema import ConfigModel, FrameId, Hz, KeyedError, Positive, Switch, Unit

Vector = tuple[float, float, float]
ZERO: Vector = (0.0, 0.0, 0.0)
LATE_PERIODS = 2
"""Longest time that one step counts, in periods of the timer. Limits the motion after a late timer."""
_Limit = Annotated[float, Field(allow_inf_nan=True), Unit("m")]
Limits = Annotated[tuple[_Limit, _Limit], Field(strict=False)]


class TeleopConfig(ConfigModel):
    """Names of the moved frame and its parent, and limits of position and speed."""

    target_frame_id: FrameId = Field(description="TF frame that is moved.")
    parent_frame_id: FrameId = Field(
        "world", description="Parent frame. The moved frame starts at the origin of this frame."
    )
    hz: Hz = Field(100.0, description="Rate at which the frame is moved and broadcast, in wall time.")
    ros_time: Switch = Field(
        False, description="Whether the frame moves in ROS time, so that it moves slowly when the simulation is slow."
    )
    xlim: Limits = Field(
        (-math.inf, math.inf), description="Least and largest x of the frame in its parent; 0 must lie between them."
    )
    ylim: Limits = Field(
        (-math.inf, math.inf), description="Least and largest y of the frame in its parent; 0 must lie between them."
    )
    zlim: Limits = Field(
        (-math.inf, math.inf), description="Least and largest z of the frame in its parent; 0 must lie between them."
    )
    max_speed: Annotated[Positive, Unit("m/s")] = Field(
        2.0, description="Largest speed of the frame. A signal with a larger speed is scaled down."
    )
    max_turn_rate: Annotated[Positive, Unit("rad/s")] = Field(
        2.0 * math.pi,
        description="Largest rate of roll, of pitch and of yaw. Each larger rate in a signal is reduced to this value.",
    )

    broadcast_always: Switch = Field(
        False,
        description="Whether the frame is also broadcast while the node is switched off, so that a robot can move to "
        "the frame first.",
    )

    @model_validator(mode="after")
    def _box_has_the_start(self) -> TeleopConfig:
        for key in ("xlim", "ylim", "zlim"):
            least, largest = getattr(self, key)
            if not least <= 0.0 <= largest:
                got = f"got [{least:g}, {largest:g}]"
                raise KeyedError(key, f"expected the least and the largest value, with 0 between them, {got}")
        if self.target_frame_id == self.parent_frame_id:
            raise KeyedError("target_frame_id", f"must differ from parent_frame_id, '{self.parent_frame_id}'")
        return self

    @property
    def box(self) -> tuple[tuple[float, float], ...]:
        """Lower and upper limits of x, y and z [m]."""
        return self.xlim, self.ylim, self.zlim


class TeleopPose(NamedTuple):
    """Pose of a frame in its parent.

    Attributes:
        position: Position x, y, z [m].
        rpy: Roll, pitch, yaw about the fixed axes of the parent, in this order, each in [-pi, pi] [rad].
    """

    position: Vector = ZERO
    rpy: Vector = ZERO


class Teleop:
    """Moves a frame by a velocity signal. Only `reset` makes the frame's pose jump.

    A late step covers at most `LATE_PERIODS` periods of `1/hz`. The frame therefore never moves by more than
    `max_speed * LATE_PERIODS / hz` [m] in one step. All times are on a clock that never goes backwards.

    Args:
        config: Names of the frame and its parent, and the limits of the motion.
        timeout_s: Time after which a signal expires if no other signal follows [s]. With 0, signals never expire.

    Attributes:
        pose: Pose of the frame in its parent.
    """

    def __init__(self, config: TeleopConfig, timeout_s: float = 0.0) -> None:
        self.pose = TeleopPose()
        self._config, self._timeout_s = config, timeout_s or math.inf
        self._linear = self._angular = ZERO
        self._commanded_s = self._stepped_s = -math.inf

    def command(self, signal: Sequence[float], now_s: float) -> bool:
        """Sets the frame's velocity until the next signal. Returns whether the velocity was reduced to the limits.

        Args:
            signal: Velocity along x, y, z of the parent [m/s], optionally followed by the rates of roll, pitch and yaw
                [rad/s]. Missing rates are 0.
            now_s: Present time [s].

        Raises:
            ValueError: If the signal does not consist of 3 or 6 finite numbers. The frame then stops.
        """
        self.stop()
        if len(signal) not in (3, 6):
            raise ValueError(
                f"expected 3 numbers (velocity) or 6 (velocity and rates of roll, pitch, yaw), got {len(signal)}"
            )
        if not all(map(math.isfinite, signal)):
            raise ValueError(f"must be finite, got {', '.join(f'{v:g}' for v in signal)}")
        x, y, z, *rates = signal
        speed, fastest = math.hypot(x, y, z), self._config.max_turn_rate
        if math.isinf(speed):
            raise ValueError(f"expected a velocity [m/s], got {x:g}, {y:g}, {z:g}")
        share = min(1.0, self._config.max_speed / speed) if speed else 1.0
        roll, pitch, yaw = (min(max(rate, -fastest), fastest) for rate in rates or ZERO)
        self._linear, self._angular = (share * x, share * y, share * z), (roll, pitch, yaw)
        self._commanded_s = now_s
        return share < 1.0 or self._angular != tuple(rates or ZERO)

    def stop(self) -> None:
        """Stops the frame until the next signal."""
        self._linear = self._angular = ZERO

    @property
    def moves(self) -> bool:
        """Whether the present signal moves the frame."""
        return any(self._linear + self._angular)

    def step(self, now_s: float) -> TeleopPose:
        """Moves the frame for the time since the last step, and returns the frame's pose.

        Stops the frame if the last signal is older than the timeout.
        """
        dt_s = min(max(now_s - self._stepped_s, 0.0), LATE_PERIODS / self._config.hz)
        self._stepped_s = now_s
        if now_s - self._commanded_s > self._timeout_s:
            self.stop()
        position, rpy = self.pose
        x, y, z = (
            min(max(value + rate * dt_s, least), largest)
            for value, rate, (least, largest) in zip(position, self._linear, self._config.box)
        )
        roll, pitch, yaw = (
            math.remainder(angle + rate * dt_s, 2.0 * math.pi) for angle, rate in zip(rpy, self._angular)
        )
        self.pose = TeleopPose((x, y, z), (roll, pitch, yaw))
        return self.pose

    def reset(self, pose: TeleopPose) -> None:
        """Sets the pose of the frame, and stops the frame until the next signal.

        Raises:
            ValueError: If the pose is outside the box or not finite. Pose and motion of the frame then stay unchanged.
        """
        if not all(map(math.isfinite, (*pose.position, *pose.rpy))):
            raise ValueError("must be finite")
        for axis, value, (least, largest) in zip("xyz", pose.position, self._config.box):
            if not least <= value <= largest:
                raise ValueError(f"{axis} must be within {least:g} and {largest:g} m, got {value:g}")
        self.stop()
        self.pose = pose
