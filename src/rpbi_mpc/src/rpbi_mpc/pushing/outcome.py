"""Measured result of a push: errors at the goal and along the path, and the misfit of the model."""

from __future__ import annotations

import math
from collections import deque
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Positive, PositiveMetres, Unit
from rpbi_mpc.pushing.planar.model import SliderConfig


class ToleranceConfig(ConfigModel):
    """Limits on the errors of a successful push.

    Measured errors at the end of the path are averaged over the second half of the settling time.

    Attributes:
        goal: Largest distance of the slider from the end of the path [m].
        goal_rad: Largest angle between the slider and the final direction of the path [rad].
        tracking: Largest mean distance of the slider from the reference during the whole push [m].
    """

    goal: PositiveMetres = Field(
        0.005, description="Largest distance of the slider from the end of the path, after the push."
    )
    goal_rad: Annotated[Positive, Unit("rad")] = Field(
        0.26, description="Largest angle between the slider and the final direction of the path, after the push."
    )
    tracking: PositiveMetres = Field(
        0.015, description="Largest mean distance of the slider from the reference during the whole push."
    )


class PushOutcome(NamedTuple):
    """Errors of a push, and the misfit of the model.

    Attributes:
        goal_m: Final distance of the slider from the end of the path [m]. NaN until the reference reaches the end.
        goal_rad: Final angle between the slider and the final direction of the path [rad]. NaN until the reference
            reaches the end.
        tracking_m: Mean distance of the slider from the reference [m].
        misfit: Mean difference between the slider's twist and the model's twist during pushing, divided by the speed
            along the path. Angular velocity is multiplied by the characteristic length.
        face_m: Measured minus modelled distance of the pushed face from the middle of the slider [m].
    """

    goal_m: float
    goal_rad: float
    tracking_m: float
    misfit: float
    face_m: float

    def fault(self, tolerance: ToleranceConfig) -> str:
        """Returns a text that names the errors larger than `tolerance`, followed by the model's misfit.

        Empty if no error is larger than `tolerance`.
        """
        faults = []
        if self.goal_m > tolerance.goal:
            faults.append(
                f"the box is {1e3 * self.goal_m:.1f} mm from its goal, expected at most {1e3 * tolerance.goal:g} mm"
            )
        if self.goal_rad > tolerance.goal_rad:
            degrees, most = math.degrees(self.goal_rad), math.degrees(tolerance.goal_rad)
            faults.append(f"the box is turned by {degrees:.1f} deg from its goal, expected at most {most:.3g} deg")
        if self.tracking_m > tolerance.tracking:
            error, most = 1e3 * self.tracking_m, 1e3 * tolerance.tracking
            faults.append(f"the box was {error:.1f} mm from the reference on average, expected at most {most:g} mm")
        return "; ".join([*faults, self.of_model]) if faults else ""

    @property
    def of_model(self) -> str:
        """Clause that describes how the box differs from the model, according to `misfit` and `face_m`."""
        side = "farther from" if self.face_m > 0.0 else "nearer to"
        return (
            f"unlike the model, the box moves by {100 * self.misfit:.0f} % of its speed, and its pushed face is "
            f"{1e3 * abs(self.face_m):.1f} mm {side} its middle"
        )

    def __str__(self) -> str:
        return (
            f"{1e3 * self.goal_m:.1f} mm and {math.degrees(self.goal_rad):.1f} deg from the goal, "
            f"{1e3 * self.tracking_m:.1f} mm from the reference on average; {self.of_model}"
        )


class PushRecord:
    """Collects the errors of all cycles of a push.

    Args:
        slider: Slider of the model.
        speed: Speed along the path [m/s].
        final_cycles: Number of final cycles over which the error at the goal is averaged.
    """

    def __init__(self, slider: SliderConfig, speed: float, final_cycles: int) -> None:
        self._scale, self._speed = np.array([1.0, 1.0, slider.characteristic_length]), speed
        self._ends: deque[np.ndarray] = deque(maxlen=final_cycles)
        self._errors: list[float] = []
        self._pushed: list[tuple[float, float]] = []

    def track(self, deviation: np.ndarray, at_end: bool) -> None:
        """Records the deviation of the measured slider from the reference.

        Args:
            deviation: Differences in x, y and yaw [m, m, rad].
            at_end: Whether the reference is at the end of the path.
        """
        self._errors.append(float(np.hypot(*deviation[:2])))
        if at_end:
            self._ends.append(deviation)

    def push(self, drift: np.ndarray, gap: float) -> None:
        """Records the misfit of the model in a cycle of pushing.

        Args:
            drift: The slider's twist minus the model's twist [m/s, m/s, rad/s].
            gap: Measured distance between pusher and face [m].
        """
        self._pushed.append((float(np.linalg.norm(self._scale * drift)) / self._speed, gap))

    @property
    def outcome(self) -> PushOutcome:
        """Errors and misfit up to now. A value without recorded data is NaN."""
        x, y, yaw = np.mean(self._ends, axis=0) if self._ends else np.full(3, math.nan)
        misfit, gap = np.mean(self._pushed, axis=0) if self._pushed else np.full(2, math.nan)
        tracking_m = float(np.mean(self._errors)) if self._errors else math.nan
        return PushOutcome(float(np.hypot(x, y)), abs(float(yaw)), tracking_m, float(misfit), float(gap))
