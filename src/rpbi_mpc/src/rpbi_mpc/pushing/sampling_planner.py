"""A planner for pushing that simulates candidate plans in forks of the world, and combines them by their costs."""

from __future__ import annotations

import dataclasses
from typing import Annotated, Any, Protocol

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import NonNegative, Positive, Seconds, Text, Unit
from rpbi_mpc.controller import ControlPlan
from rpbi_mpc.sampling.controller import SamplingConfig, SamplingController

from .config import PushingConfig
from .planar.motion import PlanarScene, gap_and_contact, rotation
from .planner import PushPlanner, PushSituation


class PushRollouts(Protocol):
    """A plant that can simulate pushes from its present state, without changing this state."""

    def scenes(self, velocities: np.ndarray, period_s: float, delay_s: float) -> np.ndarray:
        """Simulates candidates, and returns the scene after each command of each candidate.

        Args:
            velocities: Velocities of the pusher in the table's axes, shape (candidates, cycles, 2) [m/s].
            period_s: Duration of each command [s].
            delay_s: Time until the first command acts [s]. Until then, the present command continues to act.

        Returns:
            Scenes as in `PlanarScene.values`, shape (candidates, cycles, 5). NaN for a candidate that cannot be
            simulated.
        """


class PushSamplingConfig(SamplingConfig):
    """Options of the planner `sampling`. The cost also has the weights `position`, `contact` and `final`, which are
    taken from `pushing.program.weights`.

    Attributes:
        forward: Largest speed of the pusher towards the face [m/s]. The largest speed away from the face is a fifth of
            `forward`.
        across: Largest speed of the pusher along the face [m/s].
        yaw: Weight of the difference between the slider's yaw and the direction of the path [1/rad^2]. The weight must
            be large: a box that leaves a straight path turns first, but turning hardly changes the distance from the
            path within the horizon.
    """

    horizon: Seconds = Field(1.2, description="Duration of the simulated plans.")
    knots: Annotated[int, Field(ge=2)] = Field(
        3, description="Number of knots of a plan; velocities are linear between two knots."
    )
    sampler: dict[Text, Any] = Field(
        {"type": "predictive", "candidates": 16, "noise": 0.2},
        description="Sampler: its `type` (`predictive`, `cem`, `mppi`, or `module:Class` of your own) and the "
        "options of this type.",
    )
    forward: Annotated[Positive, Unit("m/s")] = Field(
        0.1,
        description="Largest speed of the pusher towards the face. The largest speed away from the face is a fifth "
        "of this speed.",
    )
    across: Annotated[Positive, Unit("m/s")] = Field(0.12, description="Largest speed of the pusher along the face.")
    yaw: NonNegative = Field(
        300.0, description="Weight of the difference between the slider's yaw and the direction of the path [1/rad^2]."
    )


RETREAT = 0.2
"""Ratio of the largest speed away from the face to the largest speed towards the face."""


class SamplingPlanner(PushPlanner):
    """Simulates candidate pushes in forks of the world, and plans with a sampler of `SAMPLERS`.

    Args:
        rollouts: Simulates the candidates.
        config: Slider, path and weights.
        sampling: Options of the sampling.
    """

    def __init__(self, rollouts: PushRollouts, config: PushingConfig, sampling: PushSamplingConfig) -> None:
        self._config = config
        self._pushes = _ScoredPushes(rollouts, config, sampling)
        along = np.array([config.path.speed, 0.0])
        self._controller = SamplingController(self._pushes, sampling, 1.0 / config.cycle_s, along)

    def reset(self) -> None:
        self._controller.reset()

    def plan(self, situation: PushSituation) -> ControlPlan:
        self._pushes.situation = situation
        plan = self._controller.sample(situation.delay_s)
        if not plan.converged:
            return plan
        return dataclasses.replace(
            plan,
            commands=self._pushes.on_the_table(plan.commands)[: self._config.plan_cycles],
            states=self._pushes.best_states,
        )


class _ScoredPushes:
    """Computes the costs of candidate pushes, with the interface of `Rollouts`.

    Commands are pusher velocities in the slider's axes: forwards and to the left [m/s].

    Attributes:
        situation: Scene, path and time from which all candidates start.
        best_states: Predicted states (x, y, yaw, contact) of the best candidate in the last call of `costs`.
    """

    names: tuple[str, ...] = ("forward", "across")
    situation: PushSituation

    def __init__(self, rollouts: PushRollouts, config: PushingConfig, sampling: PushSamplingConfig) -> None:
        self._rollouts, self._config, self._yaw = rollouts, config, sampling.yaw
        self.upper = np.array([sampling.forward, sampling.across])
        self.lower = -self.upper * (RETREAT, 1.0)
        self.best_states = np.empty((0, 4))

    def on_the_table(self, commands: np.ndarray) -> np.ndarray:
        """Rotates velocities from the slider's axes at the start of the plan to the table's axes [m/s]."""
        turned: np.ndarray = commands @ rotation(self.situation.scene.slider[2]).T
        return turned

    def costs(self, commands: np.ndarray, period_s: float, delay_s: float) -> np.ndarray:
        scenes = self._rollouts.scenes(self.on_the_table(commands), period_s, delay_s)
        gaps, contacts = self._places(scenes)
        costs = self._costs(scenes, gaps, contacts, period_s)
        best = int(np.argmin(costs))
        first = [*self.situation.scene.slider, self.situation.contact]
        self.best_states = np.vstack([first, np.column_stack([scenes[best, :, :3], contacts[best]])])
        return costs

    def _places(self, scenes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns the pusher's distances from the face, and the pusher's positions along the face [m].

        Both arrays have the shape (candidates, cycles).
        """
        slider, radius = self._config.slider, self._config.radius
        places = np.array([gap_and_contact(PlanarScene.of(each), slider, radius) for each in scenes.reshape(-1, 5)])
        gaps, contacts = places.T.reshape(2, *scenes.shape[:2])
        return gaps, contacts

    def _costs(self, scenes: np.ndarray, gaps: np.ndarray, contacts: np.ndarray, period_s: float) -> np.ndarray:
        """Returns the cost of each candidate, shape (candidates,).

        The cost is inf if a candidate was not simulated, or if the pusher leaves the face.
        """
        weights, slider = self._config.program.weights, self._config.slider
        difference = scenes[..., :3] - self.situation.reference(period_s * (1.0 + np.arange(scenes.shape[1])))
        by_cycle = (
            weights.position * (np.square(difference[..., :2]).sum(axis=-1) + np.square(gaps))
            + self._yaw * np.square(difference[..., 2])
            + weights.contact * np.square(contacts)
        )
        by_cycle[:, -1] *= weights.final
        costs = by_cycle.sum(axis=1) * period_s / self._config.program.step_s
        return np.where(np.isfinite(costs) & (np.abs(contacts).max(axis=1) <= slider.width / 2), costs, np.inf)
