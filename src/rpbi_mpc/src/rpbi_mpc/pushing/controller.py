"""The controller of a push: estimates the state, moves the pusher to the slider, and executes a planner's commands."""

from __future__ import annotations

import dataclasses
import math
from collections import deque

import numpy as np

from rpbi_mpc.controller import ControlPlan, MpcController, Sensed

from .config import PushingConfig
from .outcome import PushOutcome, PushRecord
from .planar.estimate import SceneEstimator
from .planar.motion import PlanarScene, approach_velocity, gap_and_contact, is_pushable, moved, rotation
from .planar.paths import PushPath
from .planner import ProgramPlanner, PushPlanner, PushSituation

KEPT_REFERENCES = 100
"""Number of recent references that are stored for the comparison with measurements, which arrive late."""


class PushingController(MpcController):
    """Pushes a slider along a path. The commands are velocities of a round pusher.

    The reference on the path waits while the pusher is not at the slider, and while the slider is too far behind the
    reference. Success depends on the measured pose of the slider, not on the estimated pose, which follows the model.

    Args:
        config: Slider, pusher, path and cost.
        planner: Makes plans while the pusher is at the slider. Default: `ProgramPlanner`, a nonlinear program.

    Attributes:
        path_time_s: Time along the path at which the newest plan starts [s].
    """

    measured_names = ("x", "y", "yaw", "pusher_x", "pusher_y")
    command_names = ("pusher_vx", "pusher_vy")
    state_names = ("x", "y", "yaw", "contact")

    def __init__(self, config: PushingConfig, planner: PushPlanner | None = None) -> None:
        self.config = config
        self.path = PushPath(config.path)
        self._planner = planner or ProgramPlanner(config)
        self._estimator = SceneEstimator(config.estimator, config.slider, config.radius)
        self.reset()

    def reset(self) -> None:
        self.path_time_s = 0.0
        """Time along the path at which the newest plan starts [s]."""
        self._estimator.reset()
        self._planner.reset()
        self._settled_s = 0.0
        self._off_m = 0.0
        self._pushes = False
        self._references: deque[tuple[float, float]] = deque(maxlen=KEPT_REFERENCES)
        final_cycles = max(round(0.5 * self.config.settle_s / self.config.cycle_s), 1)
        self._record = PushRecord(self.config.slider, self.path.speed, final_cycles)

    @property
    def outcome(self) -> PushOutcome:
        """Errors of the slider's measured poses, and misfit of the model, up to the present cycle."""
        return self._record.outcome

    @property
    def _is_settled(self) -> bool:
        return self._settled_s > self.config.settle_s

    @property
    def is_finished(self) -> bool:
        return self._is_settled and not self.failure

    @property
    def result(self) -> str:
        return str(self.outcome)

    @property
    def failure(self) -> str:
        most_m = self.config.max_off
        if self._off_m > most_m:
            return f"the box is {self._off_m:.3g} m off its path, max_off is {most_m:g} m"
        return self.outcome.fault(self.config.tolerance) if self._is_settled else ""

    def executed(self, time_s: float, command: np.ndarray | None) -> None:
        self._estimator.executed(time_s + self.config.lag_s, command)

    def plan(self, sensed: Sensed, delay_s: float) -> ControlPlan:
        """Predicts the scene for the time at which the first command acts, and plans commands from this scene.

        If the pusher is not at the slider, the plan moves the pusher to the slider. The cost of such a plan is NaN.
        """
        acts_s = sensed.time_s + delay_s + self.config.lag_s
        self._references.append((acts_s, self.path_time_s))
        scene = self._estimator.update(sensed, acts_s)
        self._off_m = self.path.distance(scene.slider[:2])
        gap, contact = gap_and_contact(scene, self.config.slider, self.config.radius)
        self._pushes = is_pushable(gap, contact, self.config.slider, self.config.approach, self._pushes)
        target = self.path.poses(self.path_time_s)[0]
        lag = float((target[:2] - scene.slider[:2]) @ rotation(target[2])[:, 0])
        error_m = self._note(sensed)
        if self._pushes:
            plan = self._planner.plan(PushSituation(scene, gap, contact, delay_s, self.path, self.path_time_s))
            self._go_on(lag)
        else:
            plan = self._approach(scene)
        extras = {"gap": gap, "contact": contact, "path_time_s": self.path_time_s, "lag": lag, "error_m": error_m}
        extras |= dict(zip(("reference_x", "reference_y", "reference_yaw"), map(float, target)))
        return dataclasses.replace(plan, extras=extras | plan.extras)

    def _note(self, sensed: Sensed) -> float:
        """Records the errors of a measurement, and returns the measured slider's distance from the reference [m].

        Uses the reference at the time of the measurement.
        """
        assert sensed.values is not None
        measured = PlanarScene.of(sensed.values)
        times_s, path_times_s = zip(*self._references)
        time_s = float(np.interp(sensed.time_s - sensed.age_s, times_s, path_times_s))
        deviation = measured.slider - self.path.poses(time_s)[0]
        deviation[2] = math.remainder(deviation[2], 2 * math.pi)
        self._record.track(deviation, at_end=time_s >= self.path.duration_s)
        if self._pushes:
            gap, _ = gap_and_contact(measured, self.config.slider, self.config.radius)
            self._record.push(self._estimator.drift, gap)
        return float(np.hypot(*deviation[:2]))

    def _go_on(self, lag: float) -> None:
        """Advances the reference by one cycle, unless the slider is too far behind. At the end of the path, counts the
        settling time instead.

        Args:
            lag: Lead of the reference over the slider, along the path [m].
        """
        if self.path_time_s >= self.path.duration_s:
            self._settled_s += self.config.cycle_s
        elif lag <= self.config.max_lag:
            self.path_time_s += self.config.cycle_s

    def _approach(self, scene: PlanarScene) -> ControlPlan:
        config, commands, states = self.config, [], [np.array([*scene.slider, 0.0])]
        self._planner.reset()
        for _ in range(config.plan_cycles):
            velocity = approach_velocity(scene, config.slider, config.radius, config.approach)
            scene = moved(scene, velocity, config.cycle_s, config.slider, config.radius)
            commands.append(velocity)
            states.append(np.array([*scene.slider, 0.0]))
        return ControlPlan(np.array(commands), np.array(states), config.cycle_s, math.nan, True, "approach")
