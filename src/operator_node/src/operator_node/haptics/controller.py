"""One tick of force feedback, by whatever clock: what is tested in virtual time is what people feel."""

from __future__ import annotations

import math
from typing import NamedTuple

from pydantic import Field, model_validator

from custom_ros_tools.schema import ConfigModel, Count, KeyedError, NonNegative, Positive, Vec3
from rpbi.geometry import Vector, minus, plus, scaled

from .clutch import Clutch, Target
from .coupling import Coupling, Mode, stiffest_n_per_m
from .device import HapticConfig, HapticReading, ReadingError
from .limiter import ForceLimiter
from .passivity import PassivityController
from .readings import ReadingCheck
from .vectors import ZERO, turned

SILENCE_S = 0.02
"""So long after anybody falls silent there is no force any more [s]."""
SMOOTHING_S = 0.002
"""Time constant of the velocity, where the device measures none [s]."""


class ForceFeedbackConfig(ConfigModel):
    """How a person moves the tool, and what they feel of it."""

    mode: Mode = Field("wrench", description="What is felt: the force on the tool, or a spring to where it is.")
    stiffness: Positive = Field(200.0, description="Of the spring of `mode: coupling` [N/m].")
    damping: NonNegative = Field(1.0, description="Of the damper [N s/m]; with `mode: wrench` one against the room.")
    force_scale: NonNegative = Field(1.0, description="What forces of `mode: wrench` are multiplied by.")
    force_axes: Vec3 = Field((1.0, 1.0, 1.0), description="1 for each axis that is felt, 0 for the others.")
    slew_n_per_s: Positive = Field(1000.0, description="How fast a force may grow [N/s].")
    expiry_s: float = Field(
        0.016, gt=0.0, le=0.018, description="How long what handle or tool said counts [s]; a tool says it more often."
    )
    passivity: bool = Field(True, description="Whether the passivity controller changes forces.")
    energy_reserve_j: NonNegative = Field(1.0, description="The largest energy that the observer remembers [J].")
    energy_allowance_j: float = Field(
        0.0, ge=0.0, le=0.1, description="What may be given out once without having been put in; 0 is strictly passive."
    )
    energy_refill_w: float = Field(
        0.0, ge=0.0, le=0.1, description="How fast that comes back [W]; 0 is strictly passive."
    )
    clutch_button: Count | None = Field(None, description="Number of the button to hold; without it, always engaged.")
    motion_scale: Vec3 = Field((1.0, 1.0, 1.0), description="Way of the tool for each metre of the handle; 0 holds.")
    yaw_deg: float = Field(0.0, description="By how much the handle's axes are turned about z, seen from the tool's.")
    way_low: Vec3 = Field((-1.0, -1.0, -1.0), description="Least way of the target from its start, in its axes [m].")
    way_high: Vec3 = Field((1.0, 1.0, 1.0), description="Most [m].")
    max_target_speed: Positive = Field(0.5, description="How fast the target goes at most [m/s].")

    @model_validator(mode="after")
    def _box_has_the_start(self) -> ForceFeedbackConfig:
        for low, high in zip(self.way_low, self.way_high):
            if not low <= 0.0 <= high:
                raise KeyedError("way_low", f"the start, 0, has to lie between way_low and way_high, got {low}, {high}")
        return self


class Snapshot(NamedTuple):
    """What the last sample of the device led to.

    Attributes:
        reading: The sample.
        velocity: Of the handle [m/s].
        deviation: Way of the handle since it was engaged [m]; 0 while it is not.
        way: Way of the target since the start, in the axes of the tool [m].
        force: What is sent to the device, in its axes [N].
        is_engaged: Whether handle and tool are coupled.
        time_s: When the sample was read, by the monotonic clock [s].
    """

    reading: HapticReading
    velocity: Vector
    deviation: Vector
    way: Vector
    force: Vector
    is_engaged: bool
    time_s: float


class HapticController:
    """Turns readings of the handle, and what the simulator says of the tool, into a target for it and a force.

    Forces pass: coupling, damper of the passivity controller, clamp and slew limit, last check of passivity.

    Args:
        config: What the person is to move and feel.
        device: What is known of the device.
        sample_hz: How often the device is read [Hz].
        way: Where the target is, seen from its start, in the axes of the tool [m].

    Attributes:
        force: What is sent to the device now [N].
        fault: What was refused last; empty if readings are fine.
        faults: How often readings were refused, by fault.
        snapshot: What the last sample led to; None before the first.
        stiffness_bound: Up to this stiffness a wall is passive by itself [N/m].
    """

    def __init__(self, config: ForceFeedbackConfig, device: HapticConfig, sample_hz: float, way: Vector = ZERO) -> None:
        self._config, self._max_force_n = config, device.max_force_n
        self.coupling = Coupling(config.mode, config.stiffness, config.damping, config.force_scale, config.expiry_s)
        self.passivity = PassivityController(
            device.max_force_n,
            device.max_acceleration,
            config.energy_reserve_j,
            1.0 / sample_hz,
            config.energy_allowance_j,
            config.energy_refill_w,
            device.resolution_m,
        )
        self.passivity.is_on = config.passivity
        self.stiffness_bound = stiffest_n_per_m(device.damping, config.damping, 1.0 / sample_hz)
        self._limiter = ForceLimiter(device.max_force_n, config.slew_n_per_s)
        self._check = ReadingCheck(device)
        self._clutch = Clutch(config.clutch_button)
        self._target = Target(config.motion_scale, config.way_low, config.way_high, config.max_target_speed)
        self._yaw = math.radians(config.yaw_deg)
        self._target.way = way
        self._clutch.set_way(self._handle_way(way))
        self._period_s = 1.0 / sample_hz
        self.force: Vector = ZERO
        self.fault = ""
        self.faults: dict[str, int] = {}
        self.snapshot: Snapshot | None = None
        self._position: Vector | None = None
        self._velocity = ZERO
        self._seen_s = -math.inf
        self._tool_way: Vector | None = None
        self.awaits_reset = False

    def take_wrench(self, force: Vector, now_s: float, delay_s: float = 0.0) -> None:
        """Takes the force on the tool, in its axes [N], finite."""
        if self._config.mode == "wrench":
            self.coupling.take(turned(force, -self._yaw), now_s, delay_s)

    def take_tool(self, way: Vector, now_s: float, delay_s: float = 0.0) -> None:
        """Takes the way of the tool from where it was at the start, in its axes [m]."""
        if self._config.mode == "coupling":
            self._tool_way = self._handle_way(way)
            self.coupling.take(self._tool_way, now_s, delay_s)

    def reset(self) -> None:
        """Has the target go back to its start, and the handle go on from there."""
        self.awaits_reset = True

    def lose(self) -> None:
        """Takes note that the device has gone."""
        self._drop()
        self._clutch.release()
        self._check.forget()
        self._position = None

    def tick(self, now_s: float, reading: HapticReading | None) -> Vector:
        """Returns the force for the device [N].

        Args:
            now_s: By the monotonic clock [s].
            reading: What came from the device since the last tick, if anything did.
        """
        if reading is not None:
            try:
                self._take(self._check.checked(reading, now_s), now_s)
            except ReadingError as error:
                self.refuse(error)
            else:
                self.fault = ""
                return self.force
        if now_s - self._seen_s > self._config.expiry_s or self.coupling.freshness(now_s) == 0.0:
            self._drop()
        return self.force

    def refuse(self, error: ReadingError) -> None:
        """Counts a reading that makes no sense."""
        self.fault = f"{error.fault}: {error}"
        self.faults[error.fault] = self.faults.get(error.fault, 0) + 1

    @property
    def not_finite(self) -> int:
        """How many forces were refused since a number was not finite."""
        return self._limiter.not_finite

    def _drop(self) -> None:
        if self.force != ZERO:
            self.passivity.cut()
            self._limiter.note(ZERO)
            self.force = ZERO

    def _take(self, reading: HapticReading, now_s: float) -> None:
        """Goes on by one sample."""
        position, dt_s = reading.position, now_s - self._seen_s
        was_away = self._position is None or self._check.has_moved or dt_s > SILENCE_S
        step = ZERO if self._position is None or self._check.has_moved else minus(position, self._position)
        if was_away:
            self._drop()
            self._clutch.release()
            self._velocity = ZERO
            dt_s = self._period_s
        self.passivity.observe(step)
        velocity = ZERO if was_away else scaled(1.0 / dt_s, step)  # as the passivity controller expects it
        self._velocity = reading.velocity if reading.velocity is not None else self._smoothed(velocity, dt_s)
        self._position, self._seen_s = position, now_s
        self._engage(position, reading.buttons, now_s)
        force = ZERO
        if self._clutch.engaged:
            force = self.coupling.force(self._clutch.way, self._velocity, now_s)
            axes = self._config.force_axes
            force = force[0] * axes[0], force[1] * axes[1], force[2] * axes[2]
            force = self._limiter.limited(self.passivity.damped(force, velocity), dt_s)
        self.force = self.passivity.hold(force, velocity)
        self._limiter.note(self.force)
        self.snapshot = Snapshot(
            reading,
            self._velocity,
            self._clutch.deviation,
            self._target.follow(turned(self._clutch.way, self._yaw), dt_s),
            self.force,
            self._clutch.engaged,
            now_s,
        )

    def _handle_way(self, way: Vector) -> Vector:
        """Returns the way of the handle that leads to a way of the tool, 0 along axes that are held."""
        x, y, z = (part / scale if scale else 0.0 for part, scale in zip(way, self._config.motion_scale))
        return turned((x, y, z), -self._yaw)

    def _engage(self, position: Vector, buttons: tuple[int, ...], now_s: float) -> None:
        if self.awaits_reset:
            self.awaits_reset = False
            self._clutch.set_way(ZERO)
        if self.coupling.freshness(now_s) == 0.0 and self._config.mode == "coupling":
            self._clutch.release()  # else the spring would be stretched when the tool is back
        if self._clutch.update(position, buttons):
            self.passivity.reset()
            if self._tool_way is not None:
                self._clutch.set_way(self._tool_way)
                self._clutch.update(position, buttons)

    def _smoothed(self, velocity: Vector, dt_s: float) -> Vector:
        share = dt_s / (SMOOTHING_S + dt_s)
        return plus(scaled(1.0 - share, self._velocity), scaled(share, velocity))
