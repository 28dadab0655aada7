"""Computes a motion's peak speeds and accelerations, and how much it must be slowed down to keep its limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from custom_ros_tools.schema import ConfigModel, KeyedError, ListOf, Positive, Unit, optional
from robot_model.geometry import norm
from rpbi.control.trajectories.trajectory import Trajectory

from .rotation import RotationPath

POINTS = np.linspace(0.0, 1.0, 65)
"""Fractions of a segment at which peaks of scalar rows are evaluated. In between, peaks are at most 0.1 % higher."""
TURN_POINTS = 17
"""Number of points of a segment at which peaks of orientations are evaluated."""
MARGIN = 1e-3
"""Margin between a peak and its limit, as a fraction of the peak."""
UNITS = {
    "velocity": "m/s or rad/s",
    "acceleration": "m/s^2 or rad/s^2",
    "angular_velocity": "rad/s",
    "angular_acceleration": "rad/s^2",
}

Each = Positive | ListOf[Positive]


class MotionLimitsConfig(ConfigModel):
    """Limits of the speed and acceleration of a motion through waypoints."""

    velocity: Annotated[Each, Unit("m/s, rad/s")] | None = optional(
        "Largest speed of rows that are interpolated as numbers: one for all rows, or a list. By default, the speed "
        "limits of joints in the parameter `robot_description`, if it has any."
    )
    acceleration: Annotated[Each, Unit("m/s^2, rad/s^2")] | None = optional(
        "Largest acceleration of rows that are interpolated as numbers: one for all rows, or a list. By default, "
        "accelerations are not limited."
    )
    angular_velocity: Annotated[Positive, Unit("rad/s")] | None = optional(
        "Largest angular velocity of an orientation that is interpolated as a rotation. By default, not limited."
    )
    angular_acceleration: Annotated[Positive, Unit("rad/s^2")] | None = optional(
        "Largest angular acceleration of an orientation that is interpolated as a rotation. By default, not limited."
    )
    exceeded: Literal["slow", "refuse"] = Field(
        "slow",
        description="Treatment of a motion that exceeds a limit: `slow` slows down the whole motion, `refuse` "
        "refuses it.",
    )

    def check_rows(self, count: int, method: str) -> None:
        """Checks that the limits fit the number of scalar rows and the interpolation method.

        Raises:
            KeyedError: If a list does not have the length `count`, or the method `linear` has an acceleration limit.
        """
        for key in ("velocity", "acceleration"):
            value = getattr(self, key)
            if isinstance(value, tuple) and len(value) != count:
                expected = f"expected one number, or {count}, one for each row that is interpolated as a number"
                raise KeyedError(f"interpolation.limits.{key}", f"{expected}, got {len(value)}")
        for key in ("acceleration", "angular_acceleration"):
            if getattr(self, key) is not None and method == "linear":
                raise KeyedError(f"interpolation.limits.{key}", "expected none with method 'linear', which has corners")


class Excess(NamedTuple):
    """The limit that a motion exceeds most.

    Attributes:
        stretch: Factor by which the motion's duration has to grow; at most 1 if the motion keeps all limits.
        text: Description of the limit and of the motion's peak; empty without limits.
    """

    stretch: float = 0.0
    text: str = ""


class Peaks(NamedTuple):
    """Largest speeds and accelerations of a motion.

    Attributes:
        velocity: Largest speed of each waypoint row that is interpolated as a number [m/s or rad/s], shape (S,).
        acceleration: Largest acceleration of each such row [m/s^2 or rad/s^2], shape (S,).
        angular_velocity: Largest angular speed of the orientation path [rad/s]; 0 without a path.
        angular_acceleration: Largest angular acceleration of the orientation path [rad/s^2]; 0 without a path.
    """

    velocity: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    angular_velocity: float
    angular_acceleration: float

    @classmethod
    def of(cls, scalars: Trajectory, path: RotationPath | None) -> Peaks:
        """Returns the peaks of a motion between its first and its last knot.

        Args:
            scalars: Trajectory of the waypoint rows that are interpolated as numbers.
            path: Path of the orientation; None without a path.
        """
        ends = [*(each.start_s for each in scalars.segments[1:]), scalars.end_s]
        rows = np.array([each.polynomials for each in scalars.segments])  # segments x S x 6
        spans = np.array(
            [(each.start_s - each.origin_s, end - each.origin_s) for each, end in zip(scalars.segments, ends)]
        )
        times = spans[:, :1] + POINTS * (spans[:, 1:] - spans[:, :1])
        powers = times[..., None] ** np.arange(6)  # segments x points x 6
        orders = np.arange(1.0, 6.0)
        rates = np.einsum("ksc,kpc->ksp", rows[..., 1:] * orders, powers[..., :5])
        bends = np.einsum("ksc,kpc->ksp", rows[..., 2:] * (orders[1:] * orders[:-1]), powers[..., :4])
        return cls(_largest(rates), _largest(bends), *_turning(path))

    def excess(self, limits: MotionLimitsConfig) -> Excess:
        """Returns the limit that the peaks exceed most, or the closest limit if no limit is exceeded."""
        worst = Excess()
        for key, power in zip(self._fields, (1.0, 0.5, 1.0, 0.5)):
            limit, peaks = getattr(limits, key), np.atleast_1d(getattr(self, key))
            if limit is None or not len(peaks):
                continue
            each = np.broadcast_to(limit, peaks.shape)
            row = int(np.argmax(peaks / each))
            stretch = float((1.0 + MARGIN) * peaks[row] / each[row]) ** power
            if stretch > worst.stretch:
                where = f" of row {row}" if len(peaks) > 1 else ""
                worst = Excess(stretch, f"{key}{where} {peaks[row]:.3g} {UNITS[key]}, limit {each[row]:.3g}")
        return worst

    def without_limit(self, limits: MotionLimitsConfig) -> dict[str, float]:
        """Returns the largest peak of each quantity without a limit, keyed by the quantity, such as `velocity`."""
        peaks = {key: float(np.max(getattr(self, key), initial=0.0)) for key in self._fields}
        return {key: peak for key, peak in peaks.items() if getattr(limits, key) is None and peak > 0.0}


def _largest(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the largest magnitude of each row, shape (S,), from values of shape (segments, S, points)."""
    return np.asarray(np.abs(values).max(axis=(0, 2), initial=0.0))


def _turning(path: RotationPath | None) -> tuple[float, float]:
    if path is None or not path.segments:
        return 0.0, 0.0
    ends: Sequence[float] = [*(each.start_s for each in path.segments[1:]), path.end_s]
    times = [
        np.linspace(each.start_s, math.nextafter(end, -math.inf), TURN_POINTS) for each, end in zip(path.segments, ends)
    ]
    states = [path.sample(float(time_s)) for time_s in np.concatenate(times)]
    return max(norm(each.rate) for each in states), max(norm(each.acceleration) for each in states)
