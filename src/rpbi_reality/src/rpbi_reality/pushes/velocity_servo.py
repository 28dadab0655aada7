"""A controller that moves joints along a schedule, as the velocity interface of a real arm does."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from custom_ros_tools.errors import UnknownNameError
from custom_ros_tools.schema import ConfigModel, Hz, ListOf, NonNegative, Positive, Unit
from rpbi.control.controllers.controller import (
    Array,
    ControlledRobot,
    Controller,
    ControllerConfig,
    RobotState,
    SetPoints,
)

Degrees = Annotated[float, Unit("deg")]
GRAVITY_S = 0.1
"""Interval [s] at which the torques of gravity are computed."""
MAX_DEVIATION = 0.05
"""Largest angle [rad] between a joint and the integral of its velocity, for instance when the arm is blocked."""
Delay = Annotated[NonNegative, Field(le=2.0), Unit("s")]


class ScheduledTargets(ConfigModel):
    """Targets that apply from a time on."""

    time_s: Annotated[NonNegative, Unit("s")] = Field(description="Time after the start of the schedule.")
    joints: dict[str, Degrees] = Field(description="Target angles, indexed by joint; other joints keep their targets.")


class VelocityServoConfig(ControllerConfig):
    """Configuration of a `VelocityServo`."""

    schedule: ListOf[ScheduledTargets] = Field((), description="Targets by time; the first targets are 0.")
    start_s: Annotated[NonNegative, Unit("s")] = Field(1.0, description="Simulated time at which the schedule starts.")
    rate_hz: Hz = Field(20.0, description="Rate of the velocity commands.")
    gain_per_s: Positive = Field(10.0, description="Commanded velocity for each unit of error [1/s].")
    limit_deg_per_s: Positive = Field(30.0, description="Largest commanded velocity.")
    delay_s: Delay = Field(0.0, description="Time from a command to its effect.")
    first_delay_s: Delay = Field(0.0, description="Further delay of the targets at time 0 of the schedule.")
    lag_s: Delay = Field(0.0, description="Time constant with which the velocity follows the command.")
    offset_deg: dict[str, Degrees] = Field({}, description="Offsets of the joints' zeros, indexed by joint.")
    droop_deg_per_nm: dict[str, float] = Field(
        {}, description="Angle by which a joint yields to a torque of gravity of 1 N m, indexed by joint."
    )


class VelocityServo(Controller):
    """Commands joint velocities at a fixed rate: a gain times the error, within a limit.

    The velocity follows the command after a delay, as a first-order lag. PyBullet's motors keep the joints at the
    integral of this velocity, from which they deviate by at most `MAX_DEVIATION`.
    """

    Config = VelocityServoConfig

    def __init__(self, arm: ControlledRobot, config: VelocityServoConfig) -> None:
        super().__init__(arm, config)
        self._places = {arm.model.joints[place].name: row for row, place in enumerate(arm.chosen)}
        named = [*config.offset_deg, *config.droop_deg_per_nm]
        for name in (*named, *(joint for each in config.schedule for joint in each.joints)):
            if name not in self._places:
                raise UnknownNameError("joint of the servo", name, list(self._places))
        self._offset = np.radians(self._array(config.offset_deg))
        self._droop = np.radians(self._array(config.droop_deg_per_nm))
        self._every = max(1, round(1.0 / config.rate_hz / arm.dt_s))
        self._decay = 1.0 - math.exp(-arm.dt_s / config.lag_s) if config.lag_s else 1.0
        delay = config.delay_s / arm.dt_s
        self._late, self._fraction = int(delay), delay - int(delay)

    def start(self, state: RobotState, tick: int) -> None:
        """Starts with velocity 0."""
        zero = np.zeros(len(self._places))
        self._velocity, self._command, self._torques, self._next_gravity = zero, zero, zero, tick
        self._position = np.array(state.position)[self.arm.chosen]
        self._commands = deque([zero] * (self._late + 2), self._late + 2)

    def compute(self, state: RobotState, targets: Mapping[str, Any], tick: int) -> Array | SetPoints:
        """Returns the positions at the end of the tick."""
        measured = np.array(state.position)[self.arm.chosen]
        position = np.clip(self._position, measured - MAX_DEVIATION, measured + MAX_DEVIATION)
        if tick % self._every == 0:
            limit = math.radians(self.config.limit_deg_per_s)
            wanted = self._targets(tick * self.arm.dt_s - self.config.start_s) + self._offset
            if self._droop.any():
                wanted = wanted - self._droop * self._gravity(state, tick)
            self._command = np.clip(self.config.gain_per_s * (wanted - position), -limit, limit)
        self._commands.append(self._command)
        delayed = (1.0 - self._fraction) * self._commands[1] + self._fraction * self._commands[0]
        self._velocity = self._velocity + self._decay * (delayed - self._velocity)
        self._position = position + self._velocity * self.arm.dt_s
        return SetPoints(self._position)

    def _gravity(self, state: RobotState, tick: int) -> np.ndarray:
        """Returns the torques [N m] that hold the arm against gravity, at most `GRAVITY_S` old, shape (m,)."""
        if tick >= self._next_gravity:
            still = (0.0,) * len(state.position)
            self._torques = self.arm.of_chosen(self.arm.model.bias(state.base, state.position, still))
            self._next_gravity = tick + max(1, round(GRAVITY_S / self.arm.dt_s))
        return self._torques

    def _targets(self, time_s: float) -> np.ndarray:
        """Returns the scheduled targets [rad] at a time, shape (m,)."""
        targets: dict[str, float] = {}
        for each in self.config.schedule:
            begin_s = each.time_s or self.config.first_delay_s
            if time_s >= begin_s - 1e-9:
                targets |= each.joints
        return np.radians(self._array(targets))

    def _array(self, values: Mapping[str, float]) -> np.ndarray:
        array = np.zeros(len(self._places))
        for name, value in values.items():
            array[self._places[name]] = value
        return array
