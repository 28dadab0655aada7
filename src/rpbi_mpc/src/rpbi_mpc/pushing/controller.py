"""The controller of pushing: estimates, brings the pusher to the slider, and plans along a path."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import ConfigModel, NonNegative, Positive, PositiveMetres, Seconds, Unit
from rpbi_mpc.controller import ControlPlan, MpcController
from rpbi_mpc.plant import Sensed

from .estimate import EstimatorConfig, SceneEstimator
from .model import pusher_velocity
from .motion import (
    ApproachConfig,
    PlanarScene,
    approach_velocity,
    gap_and_contact,
    is_pushable,
    moved,
    rotation,
)
from .paths import PathConfig, PushPath
from .program import ProgramConfig, PushingProgram, Solved
from .slider import SliderConfig


class PushingConfig(ConfigModel):
    """A slider, a pusher and a path.

    Attributes:
        slider: The slider.
        radius: Radius of the pusher [m].
        path: The path.
        program: Horizon, cost and solver.
        estimator: Filter of measurements.
        approach: Motion to the slider.
        gap_rate: Rate at which a gap between pusher and slider is closed while pushing [1/s].
        max_lag: Distance along the path by which the reference may be ahead of the slider; then it waits [m].
        settle_s: Time after the end of the path for which the last pose is aimed at [s].
        cycle_s: Time of a cycle, for which a command acts [s].
        lag_s: Time from a command until the pusher moves by it, beside the delay of the loop [s].
        plan_cycles: Number of commands of a plan, one for each cycle.
        max_command: Largest speed of the pusher [m/s].
    """

    slider: SliderConfig = Field(SliderConfig(), description="The slider.")
    radius: PositiveMetres = Field(0.01, description="Radius of the pusher.")
    path: PathConfig = Field(PathConfig(), description="The path.")
    program: ProgramConfig = Field(ProgramConfig(), description="Horizon, cost and solver.")
    estimator: EstimatorConfig = Field(EstimatorConfig(), description="Filter of measurements.")
    approach: ApproachConfig = Field(ApproachConfig(), description="Motion of the pusher to the slider.")
    gap_rate: Annotated[NonNegative, Unit("1/s")] = Field(5.0, description="Rate at which a gap is closed in contact.")
    max_lag: PositiveMetres = Field(0.03, description="Distance ahead of the slider at which the reference waits.")
    settle_s: Annotated[NonNegative, Unit("s")] = Field(1.0, description="Time at the last pose of the path.")
    cycle_s: Seconds = Field(0.04, description="Time of a cycle.")
    lag_s: Annotated[NonNegative, Unit("s")] = Field(0.0, description="Time until the pusher moves by a command.")
    plan_cycles: Annotated[int, Field(ge=1)] = Field(6, description="Commands of a plan, one for each cycle.")
    max_command: Annotated[Positive, Unit("m/s")] = Field(0.2, description="Largest speed of the pusher.")


class PushingController(MpcController):
    """Pushes a slider along a path by a round pusher, whose velocity is commanded.

    The time of the path stands still while the pusher is not at the slider, and while the slider is too far behind
    the reference.

    Args:
        config: Slider, pusher, path and cost.
    """

    measured_names = ("x", "y", "yaw", "pusher_x", "pusher_y")
    command_names = ("pusher_vx", "pusher_vy")
    state_names = ("x", "y", "yaw", "contact")

    def __init__(self, config: PushingConfig) -> None:
        self.config = config
        self.path = PushPath(config.path)
        self._program = PushingProgram(config.slider, config.program)
        self._estimator = SceneEstimator(config.estimator, config.slider, config.radius)
        self.reset()

    def reset(self) -> None:
        self.path_time_s = 0.0
        """Time along the path for the newest plan [s]."""
        self._estimator.reset()
        self._guess: np.ndarray | None = None
        self._force = np.array([self.path.speed, 0.0])
        self._settled_s = 0.0
        self._pushes = False

    @property
    def is_finished(self) -> bool:
        return self._settled_s > self.config.settle_s

    def executed(self, time_s: float, command: np.ndarray | None) -> None:
        self._estimator.executed(time_s + self.config.lag_s, command)

    def plan(self, sensed: Sensed, delay_s: float) -> ControlPlan:
        """Returns commands from the scene that is expected when the first one acts.

        A plan of the approach has commands and no solution; its cost is NaN.
        """
        assert sensed.values is not None
        scene = self._estimator.update(sensed, sensed.time_s + delay_s + self.config.lag_s)
        gap, contact = gap_and_contact(scene, self.config.slider, self.config.radius)
        self._pushes = is_pushable(gap, contact, self.config.slider, self.config.approach, self._pushes)
        target = self.path.poses(self.path_time_s)[0]
        lag = float((target[:2] - scene.slider[:2]) @ rotation(target[2])[:, 0])
        extras = {"gap": gap, "contact": contact, "path_time_s": self.path_time_s, "lag": lag}
        extras |= dict(zip(("reference_x", "reference_y", "reference_yaw"), map(float, target)))
        if not self._pushes:
            return self._approach(scene, extras)
        plan = self._push(scene, gap, contact, extras)
        self._go_on(lag)
        return plan

    def _go_on(self, lag: float) -> None:
        """Moves the reference on by a cycle, unless the slider is too far behind it."""
        if self.path_time_s >= self.path.duration_s:
            self._settled_s += self.config.cycle_s
        elif lag <= self.config.max_lag:
            self.path_time_s += self.config.cycle_s

    def _approach(self, scene: PlanarScene, extras: dict[str, float]) -> ControlPlan:
        config, commands, states = self.config, [], [np.array([*scene.slider, 0.0])]
        self._guess, self._force = None, np.array([self.path.speed, 0.0])
        for _ in range(config.plan_cycles):
            velocity = approach_velocity(scene, config.slider, config.radius, config.approach)
            scene = moved(scene, velocity, config.cycle_s, config.slider, config.radius)
            commands.append(velocity)
            states.append(np.array([*scene.slider, 0.0]))
        return ControlPlan(
            np.array(commands), np.array(states), config.cycle_s, math.nan, True, "approach", extras=extras
        )

    def _push(self, scene: PlanarScene, gap: float, contact: float, extras: dict[str, float]) -> ControlPlan:
        reach = self.config.slider.reach
        state = np.array([*scene.slider, np.clip(contact, -reach, reach)])
        solved = self._solve(state)
        if solved.converged:
            self._force = solved.inputs[0, :2]
            self._guess = self._program.guess_of(solved.states, solved.inputs)
        else:
            self._guess = None
        commands = self._commands(solved, max(gap, 0.0))
        return ControlPlan(
            commands,
            solved.states,
            self.config.program.step_s,
            solved.cost,
            solved.converged,
            solved.status,
            solved.iterations,
            solved.wall_s,
            solved.processor_s,
            extras,
        )

    def _solve(self, state: np.ndarray) -> Solved:
        program = self.config.program
        times = self.path_time_s + program.step_s * np.arange(program.steps + 1)
        reference = self.path.poses(times)
        reference[:, 2] += 2 * math.pi * round((state[2] - reference[0, 2]) / (2 * math.pi))
        speed = self.path.speed if self.path_time_s < self.path.duration_s else 0.0
        guess = self._guess
        if guess is None:
            states = np.tile(state, (program.steps + 1, 1))
            guess = self._program.guess_of(states, np.tile([self.path.speed, 0.0, 0.0, 0.0], (program.steps, 1)))
        return self._program.solve(state, reference, speed, self._force, guess)

    def _commands(self, solved: Solved, gap: float) -> np.ndarray:
        """Returns velocities of the pusher in the axes of the table, one for each cycle."""
        config = self.config
        rows = []
        for cycle in range(config.plan_cycles):
            step = min(int(cycle * config.cycle_s / config.program.step_s), len(solved.inputs) - 1)
            state, control = solved.states[step], solved.inputs[step]
            velocity = np.array(pusher_velocity(state, control, config.slider), dtype=float)
            velocity[0] += config.gap_rate * gap * (cycle == 0)
            rows.append(rotation(state[2]) @ _limited(velocity, config.max_command))
        return np.array(rows)


def _limited(velocity: np.ndarray, most: float) -> np.ndarray:
    """Returns a velocity in the same direction that is not faster."""
    speed = float(np.hypot(*velocity))
    return velocity if speed <= most else velocity * (most / speed)
