"""Filters the poses of one tracked object: drops outliers and smooths the other poses with the one-euro filter."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Count, Hz, HzOrOff, NonNegative, NonNegativeMetres, Positive, Unit
from robot_model.geometry import (
    Pose,
    Quaternion,
    Vector,
    minus,
    normalized,
    plus,
    quaternion_of,
    quaternion_product,
    rotation_between,
    scaled,
)


class SmoothingConfig(ConfigModel):
    """Parameters of a low-pass filter for poses. Its cut-off frequency grows with speed, to reduce the delay."""

    min_cutoff_hz: HzOrOff = Field(
        2.0, description="Cut-off frequency of the pose filter at rest; 0 disables smoothing."
    )
    per_speed: Annotated[NonNegative, Unit("Hz/(m/s)")] = Field(
        20.0, description="Increase of the cut-off frequency with the object's speed."
    )
    per_angular_speed: Annotated[NonNegative, Unit("Hz/(rad/s)")] = Field(
        5.0, description="Increase of the cut-off frequency with the object's angular speed."
    )
    speed_cutoff_hz: Hz = Field(2.0, description="Cut-off frequency of the low-pass filter for the speeds.")


class OneEuroPose:
    """Low-pass filter for poses, with a cut-off frequency that grows with speed. Samples may be unevenly spaced.

    Formulas: Casiez, Roussel, Vogel, "1 Euro Filter", CHI 2012. Different from the paper, the gain is
    `1 - exp(-2 pi f dt)`, which assumes a constant input between samples. Orientations are filtered along the shortest
    rotation.
    """

    def __init__(self, config: SmoothingConfig) -> None:
        self._config = config
        self._velocity: Vector = (0.0, 0.0, 0.0)
        self._rotation: Vector = (0.0, 0.0, 0.0)
        self._last: Pose | None = None
        self.output: Pose | None = None
        """Newest filtered pose; None before the first sample."""

    def step(self, pose: Pose, dt_s: float) -> Pose:
        """Filters a pose that was measured `dt_s` [s] after the previous pose, and returns the filtered pose."""
        if self.output is None or self._last is None:
            self._last = self.output = pose
            return pose
        config = self._config
        gain = _gain(config.speed_cutoff_hz, dt_s)
        velocity = scaled(1.0 / dt_s, minus(pose.position, self._last.position))
        rotation = scaled(1.0 / dt_s, rotation_between(self._last.quat_xyzw, pose.quat_xyzw))
        self._velocity = plus(self._velocity, scaled(gain, minus(velocity, self._velocity)))
        self._rotation = plus(self._rotation, scaled(gain, minus(rotation, self._rotation)))
        self._last = pose
        linear = _gain(config.min_cutoff_hz + config.per_speed * math.hypot(*self._velocity), dt_s)
        angular = _gain(config.min_cutoff_hz + config.per_angular_speed * math.hypot(*self._rotation), dt_s)
        position = plus(self.output.position, scaled(linear, minus(pose.position, self.output.position)))
        self.output = Pose(position, _between(self.output.quat_xyzw, pose.quat_xyzw, angular))
        return self.output


def _gain(cutoff_hz: float, dt_s: float) -> float:
    return -math.expm1(-2.0 * math.pi * cutoff_hz * dt_s)


def _between(start: Quaternion, end: Quaternion, share: float) -> Quaternion:
    """Returns the orientation at a fraction `share`, 0 to 1, of the shortest rotation from `start` to `end`."""
    turn = quaternion_of(scaled(share, rotation_between(start, end)))
    return normalized(quaternion_product(turn, start))


class OutlierConfig(ConfigModel):
    """Limits of an object's motion. A pose that exceeds a limit is dropped as an outlier.

    After several consecutive outliers that are consistent with each other, the new poses are accepted.
    """

    max_speed: Annotated[Positive, Unit("m/s")] = Field(5.0, description="Largest speed of the object.")
    max_angular_speed: Annotated[Positive, Unit("rad/s")] = Field(
        20.0, description="Largest angular speed of the object."
    )
    tolerance_m: NonNegativeMetres = Field(
        0.02, description="Distance added to the motion at `max_speed`, to allow for noise."
    )
    tolerance_rad: Annotated[NonNegative, Unit("rad")] = Field(
        0.2, description="Angle added to the rotation at `max_angular_speed`, to allow for noise."
    )
    in_a_row: Annotated[Count, Field(ge=1)] = Field(
        5,
        description="Number of consecutive outliers, consistent with each other, after which poses are accepted "
        "again; 1 accepts all poses.",
    )


class OutlierError(ValueError):
    """A pose is an outlier, since the object cannot have moved to the pose in the given time."""


class PoseTracker:
    """Drops outliers from the poses of one object, and smooths the other poses. Time is taken from the stamps.

    Args:
        smoothing: Parameters of the low-pass filter.
        outliers: Limits of the object's motion. A pose that exceeds a limit is an outlier.
        timeout_s: Time without a pose after which the filter restarts [s].
    """

    def __init__(self, smoothing: SmoothingConfig, outliers: OutlierConfig, timeout_s: float) -> None:
        self._smoothing, self._outliers, self._timeout_s = smoothing, outliers, timeout_s
        self._pose: Pose | None = None
        self._stamp_s: float | None = None
        self._left_out: list[tuple[Pose, float]] = []
        self._filter: OneEuroPose | None = None
        self._forget()

    def observe(self, pose: Pose, stamp_s: float) -> Pose | None:
        """Adds a pose with its stamp [s], and returns the smoothed pose.

        Returns None if the stamp is not later than the last accepted pose's stamp, for example in repeated messages.

        Raises:
            OutlierError: If the object cannot have moved to the pose. The pose is dropped.
        """
        age_s = math.inf if self._stamp_s is None else stamp_s - self._stamp_s
        if age_s > self._timeout_s or age_s < -self._timeout_s:  # visible again, or the clock was changed
            self._forget()
        elif age_s <= 0.0:
            return None
        self._refuse_outlier(pose, stamp_s)
        dt_s = 0.0 if self._stamp_s is None else stamp_s - self._stamp_s
        self._stamp_s, self._pose, self._left_out = stamp_s, pose, []
        return pose if self._filter is None else self._filter.step(pose, dt_s)

    def _refuse_outlier(self, pose: Pose, stamp_s: float) -> None:
        if self._pose is None or self._stamp_s is None:
            return
        reason = self._impossible(self._pose, pose, stamp_s - self._stamp_s)
        if reason is None:
            return
        left_out = self._left_out
        if left_out:
            last, last_s = left_out[-1]
            if stamp_s <= last_s or self._impossible(last, pose, stamp_s - last_s) is not None:
                left_out.clear()
        left_out.append((pose, stamp_s))
        if len(left_out) < self._outliers.in_a_row:
            raise OutlierError(reason)
        self._forget()

    def _impossible(self, start: Pose, end: Pose, dt_s: float) -> str | None:
        """Returns the reason why the object cannot move from `start` to `end` within `dt_s` [s]; None if it can."""
        limits = self._outliers
        way = math.dist(start.position, end.position)
        turn = math.hypot(*rotation_between(start.quat_xyzw, end.quat_xyzw))
        if way > limits.tolerance_m + limits.max_speed * dt_s:
            return f"outlier: {way:.3g} m in {dt_s:.3g} s is more than max_speed {limits.max_speed:g} m/s allows"
        if turn > limits.tolerance_rad + limits.max_angular_speed * dt_s:
            most = f"max_angular_speed {limits.max_angular_speed:g} rad/s"
            return f"outlier: {turn:.3g} rad in {dt_s:.3g} s is more than {most} allows"
        return None

    def _forget(self) -> None:
        self._pose, self._stamp_s, self._left_out = None, None, []
        self._filter = OneEuroPose(self._smoothing) if self._smoothing.min_cutoff_hz else None
