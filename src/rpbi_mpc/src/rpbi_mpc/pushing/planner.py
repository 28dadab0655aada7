"""Interface of planners for pushing, and a planner that solves a nonlinear program."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rpbi_mpc.controller import ControlPlan

from .config import PushingConfig
from .planar.model import pusher_velocity
from .planar.motion import PlanarScene, rotation
from .planar.paths import PushPath

if TYPE_CHECKING:
    from .program import Solved


class PushSituation(NamedTuple):
    """Scene, path and time from which a planner starts.

    Attributes:
        scene: Scene predicted for the time at which the first command acts.
        gap: Distance between pusher and face in this scene [m]. Negative if the pusher is inside the slider.
        contact: Position of the pusher along the face in this scene [m].
        delay_s: Time until the first command acts [s].
        path: The path of the slider.
        path_time_s: Time along the path at which the first command acts [s].
    """

    scene: PlanarScene
    gap: float
    contact: float
    delay_s: float
    path: PushPath
    path_time_s: float

    def reference(self, times_s: np.ndarray) -> np.ndarray:
        """Returns the slider's reference poses.

        Args:
            times_s: Times since the start of the first command, shape (N,) [s].

        Returns:
            x, y and yaw, shape (N, 3) [m, m, rad]. The first yaw differs by at most half a turn from the slider's yaw.
        """
        poses = self.path.poses(self.path_time_s + times_s)
        poses[:, 2] += 2 * math.pi * round((self.scene.slider[2] - poses[0, 2]) / (2 * math.pi))
        return poses

    @property
    def speed(self) -> float:
        """Speed along the path [m/s]. At the end of the path, the speed is 0."""
        return self.path.speed if self.path_time_s < self.path.duration_s else 0.0


class PushPlanner(ABC):
    """Plans velocities of a pusher in contact with the slider."""

    @abstractmethod
    def plan(self, situation: PushSituation) -> ControlPlan:
        """Returns a plan for the pusher.

        Commands are pusher velocities in the table's axes [m/s]. States are (x, y, yaw, contact) [m, m, rad, m].
        """

    @abstractmethod
    def reset(self) -> None:
        """Discards the last plan."""


class ProgramPlanner(PushPlanner):
    """Solves `PushingProgram` in each cycle, with a warm start from the last solution.

    `extras` of each plan has three numbers for the first step. `normal` and `tangential` are the components of the
    force, expressed as the speed that the force causes [m/s]. `sliding` is the pusher's speed to the left along the
    face [m/s].

    Args:
        config: Slider, pusher, path and cost.

    Raises:
        MissingDependency: If CasADi is not installed.
    """

    def __init__(self, config: PushingConfig) -> None:
        from .program import PushingProgram  # here, since other planners need no CasADi

        self._config = config
        self._program = PushingProgram(config.slider, config.program)
        self.reset()

    def reset(self) -> None:
        self._guess: np.ndarray | None = None
        self._force = np.array([self._config.path.speed, 0.0])

    def plan(self, situation: PushSituation) -> ControlPlan:
        solved = self._solve(situation)
        if solved.converged:
            self._force = solved.inputs[0, :2]
            self._guess = self._program.guess_of(solved.states, solved.inputs)
        else:
            self._guess = None
        normal, tangential, left, right = map(float, solved.inputs[0])
        return ControlPlan(
            self._commands(solved, max(situation.gap, 0.0)),
            solved.states,
            self._config.program.step_s,
            solved.cost,
            solved.converged,
            solved.status,
            solved.iterations,
            solved.wall_s,
            solved.processor_s,
            {"normal": normal, "tangential": tangential, "sliding": left - right},
        )

    def _solve(self, situation: PushSituation) -> Solved:
        config, reach = self._config.program, self._config.slider.reach
        state = np.array([*situation.scene.slider, np.clip(situation.contact, -reach, reach)])
        reference = situation.reference(config.step_s * np.arange(config.steps + 1))
        guess = self._guess
        if guess is None:
            states = np.tile(state, (config.steps + 1, 1))
            inputs = np.tile([situation.path.speed, 0.0, 0.0, 0.0], (config.steps, 1))
            guess = self._program.guess_of(states, inputs)
        return self._program.solve(state, reference, situation.speed, self._force, guess)

    def _commands(self, solved: Solved, gap: float) -> np.ndarray:
        """Returns the pusher's velocity in the table's axes for each cycle, shape (plan_cycles, 2) [m/s].

        Args:
            solved: Solution of the program.
            gap: Distance between pusher and face [m], which the first command reduces.
        """
        config = self._config
        rows = []
        for cycle in range(config.plan_cycles):
            step = min(int(cycle * config.cycle_s / config.program.step_s), len(solved.inputs) - 1)
            state, control = solved.states[step], solved.inputs[step]
            velocity = np.array(pusher_velocity(state, control, config.slider), dtype=float)
            velocity[0] += config.gap_rate * gap * (cycle == 0)
            rows.append(rotation(state[2]) @ _limited(velocity, config.max_command))
        return np.array(rows)


def _limited(velocity: np.ndarray, most: float) -> np.ndarray:
    """Scales a velocity down to the speed `most` [m/s] if the velocity is faster."""
    speed = float(np.hypot(*velocity))
    return velocity if speed <= most else velocity * (most / speed)
