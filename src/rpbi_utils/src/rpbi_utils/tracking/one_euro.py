"""The one-euro filter, of poses."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Hz, HzOrOff, NonNegative, Unit
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
    """Smoothing of poses: strongest at rest, with the lowest frequency, and weaker in motion, to reduce the delay."""

    min_cutoff_hz: HzOrOff = Field(2.0, description="Cut-off frequency at rest; 0 leaves poses as they are.")
    per_speed: Annotated[NonNegative, Unit("Hz/(m/s)")] = Field(
        20.0, description="Increase of the cut-off frequency per m/s."
    )
    per_angular_speed: Annotated[NonNegative, Unit("Hz/(rad/s)")] = Field(
        5.0, description="Increase of the cut-off frequency per rad/s."
    )
    speed_cutoff_hz: Hz = Field(2.0, description="Cut-off frequency of the low-pass of the speeds.")


class OneEuroPose:
    """A low-pass of poses whose cut-off frequency grows with the speed, for samples at any spacing.

    Formulas: Casiez, Roussel, Vogel, "1 Euro Filter", CHI 2012; the gain of a low-pass is `1 - exp(-2 pi f dt)`, as
    for a value that is held between samples. Orientations move along the shortest rotation by the same share.
    """

    def __init__(self, config: SmoothingConfig) -> None:
        self._config = config
        self._velocity: Vector = (0.0, 0.0, 0.0)
        self._rotation: Vector = (0.0, 0.0, 0.0)
        self._last: Pose | None = None
        self.output: Pose | None = None
        """The newest pose, None before the first."""

    def step(self, pose: Pose, dt_s: float) -> Pose:
        """Filters a pose that is `dt_s` later than the previous one; returns the smoothed one."""
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
    """Returns the orientation that is a share of the shortest rotation from one to another."""
    turn = quaternion_of(scaled(share, rotation_between(start, end)))
    return normalized(quaternion_product(turn, start))
