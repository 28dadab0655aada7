"""Estimates the poses of slider and pusher from late, noisy measurements, and predicts both for the next command."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import ConfigModel
from rpbi_mpc.controller import Sensed

from .model import SliderConfig
from .motion import PlanarScene, moved, rotation

KEPT_S = 2.0
"""Time for which commands are stored [s]. Measurements must not be older, since predictions need all later commands."""

DRIFT_S = 1.0
"""Time constant of the filter of `SceneEstimator.drift` [s]."""

Share = Annotated[float, Field(gt=0.0, le=1.0)]


class EstimatorConfig(ConfigModel):
    """Gains of the estimator. In each cycle, a share of the difference between measurement and prediction is corrected.

    Attributes:
        position: Share of the difference in position that is corrected.
        yaw: Share of the difference in yaw that is corrected.
        jump: Distance between measurement and prediction beyond which the measurement replaces the estimate [m].
        jump_rad: Difference in yaw beyond which the measurement replaces the estimate [rad].
    """

    position: Share = Field(
        0.4,
        description="Fraction of the difference between measured and predicted position that is corrected in a cycle.",
    )
    yaw: Share = Field(
        0.4, description="Fraction of the difference between measured and predicted yaw that is corrected in a cycle."
    )
    jump: Annotated[float, Field(gt=0.0)] = Field(
        0.012,
        description="Distance between measured and predicted position above which the measurement replaces the "
        "estimate [m].",
    )
    jump_rad: Annotated[float, Field(gt=0.0)] = Field(
        0.15,
        description="Difference between measured and predicted yaw above which the measurement replaces the estimate "
        "[rad].",
    )


class SceneEstimator:
    """Corrects the predictions of the model with measurements (an observer with fixed gains, D. Luenberger, 1964).

    Args:
        config: Gains of the correction.
        slider: The slider.
        radius: Radius of the pusher [m].

    Attributes:
        drift: The slider's twist minus the model's twist, filtered, in the slider's axes [m/s, m/s, rad/s].
    """

    def __init__(self, config: EstimatorConfig, slider: SliderConfig, radius: float) -> None:
        self._config, self._slider, self._radius = config, slider, radius
        self.reset()

    def reset(self) -> None:
        """Discards the estimate and all recorded commands."""
        self._estimate: PlanarScene | None = None
        self._time_s = -math.inf
        self.drift = np.zeros(3)
        self._commands: list[tuple[float, np.ndarray]] = []

    def executed(self, time_s: float, command: np.ndarray | None) -> None:
        """Records the pusher's velocity, shape (2,) [m/s], from `time_s` [s] on. None: the pusher is at rest."""
        self._commands.append((time_s, np.zeros(2) if command is None else np.asarray(command)))
        while len(self._commands) > 2 and self._commands[1][0] < time_s - KEPT_S:
            del self._commands[0]

    def update(self, sensed: Sensed, ahead_s: float) -> PlanarScene:
        """Corrects the estimate with a measurement, and returns the scene predicted for a later time.

        Args:
            sensed: A complete measurement (x, y, yaw, pusher_x, pusher_y).
            ahead_s: Plant time (not a duration) for which the scene is predicted [s].
        """
        measured_s = sensed.time_s - sensed.age_s
        assert sensed.values is not None
        measured = PlanarScene.of(sensed.values)
        if self._estimate is None:
            self._estimate = measured
        else:
            expected = self._predicted(self._estimate, self._time_s, measured_s)
            self._estimate = self._corrected(expected, measured, measured_s - self._time_s)
        self._time_s = measured_s
        return self._predicted(self._estimate, measured_s, ahead_s)

    def _corrected(self, expected: PlanarScene, measured: PlanarScene, passed_s: float) -> PlanarScene:
        difference = measured.slider - expected.slider
        difference[2] = math.remainder(difference[2], 2 * math.pi)
        jumps = np.hypot(*difference[:2]) > self._config.jump or abs(difference[2]) > self._config.jump_rad
        gains = np.ones(3) if jumps else np.array([self._config.position, self._config.position, self._config.yaw])
        if passed_s > 0.0:
            change = gains * difference
            rate = np.append(rotation(expected.slider[2]).T @ change[:2], change[2]) / passed_s
            self.drift += min(passed_s / DRIFT_S, 1.0) * (rate - self.drift)
        return PlanarScene(expected.slider + gains * difference, measured.pusher)

    def _predicted(self, scene: PlanarScene, begin_s: float, end_s: float) -> PlanarScene:
        """Predicts the scene at `end_s` [s] from the scene at `begin_s` [s], with the recorded commands."""
        edges = [*(time_s for time_s, _ in self._commands), math.inf]
        for (start_s, velocity), stop_s in zip(self._commands, edges[1:]):
            duration_s = min(stop_s, end_s) - max(start_s, begin_s)
            if duration_s > 1e-9:
                scene = moved(scene, velocity, duration_s, self._slider, self._radius)
        return scene
