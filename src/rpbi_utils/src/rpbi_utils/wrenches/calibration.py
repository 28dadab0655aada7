"""Configuration of `calibrate_wrench_node.py`, mean wrenches of a sensor at rest, and the correction of wrenches."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from custom_ros_tools.schema import (
    ConfigModel,
    Count,
    FrameId,
    Position,
    Positive,
    PositiveMetres,
    Unit,
    Vec3,
    optional,
)
from robot_model.geometry import Pose, Vector, rotated_back, rotation_between

Array = NDArray[np.float64]
Newton = Annotated[Positive, Unit("N")]
NewtonMetre = Annotated[Positive, Unit("N m")]


class MovedError(ValueError):
    """The sensor moved or was touched while a mean was computed."""


class PayloadConfig(ConfigModel):
    """Mass and centre of mass of a payload, and the wrench that the sensor reports without a load."""

    mass: Annotated[float, Unit("kg")] = Field(
        description="Mass of the payload; negative if the sensor reports the wrench that acts on the sensor instead "
        "of the wrench that the sensor exerts."
    )
    centre: Position = Field(description="Centre of mass of the payload in the sensor's frame.")
    force_offset: Annotated[Vec3, Unit("N")] = Field(
        (0.0, 0.0, 0.0), description="Force that the sensor reports without a load."
    )
    torque_offset: Annotated[Vec3, Unit("N m")] = Field(
        (0.0, 0.0, 0.0), description="Torque that the sensor reports without a load."
    )

    def weight(self, gravity: Vector) -> Array:
        """Returns the force and torque that the payload's weight adds to the sensor's reading [N, N m], shape (6,).

        Args:
            gravity: Gravity vector in the sensor's axes [m/s^2].
        """
        force = -self.mass * np.asarray(gravity)
        return np.concatenate([force, np.cross(self.centre, force)])

    @property
    def offset(self) -> Array:
        """Force and torque that the sensor reports without a load [N, N m], shape (6,)."""
        return np.array(self.force_offset + self.torque_offset)


class CalibrationParameters(ConfigModel):
    """Private parameters of `calibrate_wrench_node.py`."""

    max_samples: Annotated[Count, Field(ge=1)] = Field(
        100, description="Number of messages over which a mean is computed."
    )
    sensor_frame: FrameId | None = optional("TF frame of the sensor. By default, the frame in the messages.")
    gravity_frame: FrameId = Field("rpbi/world", description="TF frame in which gravity points along -z.")
    gravity: Annotated[Positive, Unit("m/s^2")] = Field(9.81, description="Gravitational acceleration.")
    max_force_spread: Newton = Field(
        1.0, description="Largest standard deviation of a force component of a sensor at rest."
    )
    max_torque_spread: NewtonMetre = Field(
        0.1, description="Largest standard deviation of a torque component of a sensor at rest."
    )
    max_shift: PositiveMetres = Field(0.001, description="Largest displacement of the frame of a sensor at rest.")
    max_turn: Annotated[Positive, Unit("rad")] = Field(
        0.005, description="Largest rotation of the frame of a sensor at rest."
    )
    max_residual_force: Newton = Field(
        1.0, description="Largest residual of the forces with which an identified payload is accepted."
    )
    max_residual_torque: NewtonMetre = Field(
        0.1, description="Largest residual of the torques with which an identified payload is accepted."
    )
    payload: PayloadConfig | None = optional(
        "Known payload, for instance one that was identified before. By default, no payload is known."
    )


class RestingMean:
    """Mean of `max_samples` wrenches of a sensor at rest.

    Args:
        limits: Parameters with the number of wrenches and the maximum deviations of wrenches and poses.
    """

    def __init__(self, limits: CalibrationParameters) -> None:
        self._limits = limits
        self._wrenches: list[Array] = []
        self._poses: list[Pose] = []

    @property
    def is_complete(self) -> bool:
        """Whether enough wrenches have been added."""
        return len(self._wrenches) >= self._limits.max_samples

    def add(self, wrench: Array, pose: Pose | None) -> None:
        """Adds a wrench [N, N m], shape (6,), and the sensor's pose at that time; None if the pose is unknown."""
        self._wrenches.append(wrench)
        if pose is not None:
            self._poses.append(pose)

    def result(self) -> tuple[Array, Pose | None]:
        """Returns the mean wrench [N, N m], shape (6,), and the sensor's last pose.

        The pose is None if one of the added poses is unknown.

        Raises:
            MovedError: If the sensor moved or the wrench changed by more than the limits.
        """
        limits = self._limits
        for kind, unit, spread, most in (
            ("force", "N", self._spread(slice(0, 3)), limits.max_force_spread),
            ("torque", "N m", self._spread(slice(3, 6)), limits.max_torque_spread),
        ):
            if spread > most:
                raise MovedError(f"the {kind} changes: expected a spread of {most:g} {unit} at most, got {spread:.3g}")
        for what, unit, moved, most in (
            ("moves", "m", self._shift(), limits.max_shift),
            ("turns", "rad", self._turn(), limits.max_turn),
        ):
            if moved > most:
                raise MovedError(f"the sensor {what}: expected {most:g} {unit} at most, got {moved:.3g}")
        is_known = len(self._poses) == len(self._wrenches)
        return np.mean(self._wrenches, axis=0), self._poses[-1] if is_known else None

    def _spread(self, part: slice) -> float:
        return float(np.std(self._wrenches, axis=0)[part].max())

    def _shift(self) -> float:
        return max((math.dist(self._poses[0].position, each.position) for each in self._poses), default=0.0)

    def _turn(self) -> float:
        turns = (rotation_between(self._poses[0].quat_xyzw, each.quat_xyzw) for each in self._poses)
        return max((math.hypot(*turn) for turn in turns), default=0.0)


class WrenchCalibration:
    """Subtracts a sensor's zero offset and a payload's weight from wrenches.

    Attributes:
        offset: The sensor's zero offset [N, N m], shape (6,); None before the first zeroing.
        payload: Payload whose weight is subtracted; None without a payload.
    """

    def __init__(self, payload: PayloadConfig | None = None) -> None:
        self.payload = payload
        self.offset: Array | None = None if payload is None else payload.offset

    def zero(self, mean: Array, gravity: Vector | None) -> None:
        """Sets the zero offset to the mean wrench of a sensor without contact, minus the payload's weight.

        Args:
            mean: Mean wrench [N, N m], shape (6,).
            gravity: Gravity vector in the sensor's axes [m/s^2]; may be None without a payload.
        """
        self.offset = mean - self._weight(gravity)

    def use(self, payload: PayloadConfig) -> None:
        """Sets the payload, and the zero offset that was identified together with the payload."""
        self.payload, self.offset = payload, payload.offset

    def calibrated(self, wrench: Array, gravity: Vector | None) -> Array:
        """Returns a wrench minus the zero offset and the payload's weight [N, N m], shape (6,).

        Args:
            wrench: Measured wrench [N, N m], shape (6,).
            gravity: Gravity vector in the sensor's axes [m/s^2]; may be None without a payload.
        """
        assert self.offset is not None
        return wrench - self.offset - self._weight(gravity)

    def _weight(self, gravity: Vector | None) -> Array:
        if self.payload is None:
            return np.zeros(6)
        assert gravity is not None
        return self.payload.weight(gravity)


def gravity_in(pose: Pose, gravity: float) -> Vector:
    """Returns the gravity vector in a sensor's axes [m/s^2].

    Args:
        pose: Pose of the sensor in a frame whose z axis points up.
        gravity: Magnitude of gravity [m/s^2].
    """
    return rotated_back(pose.quat_xyzw, (0.0, 0.0, -gravity))


def listed(values: Sequence[float], digits: int = 3) -> str:
    """Returns numbers as text, separated by commas and rounded to `digits` decimals."""
    return ", ".join(f"{value:.{digits}f}" for value in values)
