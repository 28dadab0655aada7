"""Computes one tick of force feedback. The caller passes the time, so tests can run the same code in virtual time."""

from __future__ import annotations

import math
from typing import NamedTuple

from robot_model.geometry import ZERO, Vector, dot, minus, norm, plus, scaled, turned_about_z

from .config import ForceFeedbackConfig
from .coupling import Clutch, TargetFollower, VirtualCoupling, stiffest_n_per_m
from .device import HapticConfig, HapticReading, ReadingError
from .passivity import PassivityController
from .readings import ReadingCheck

SILENCE_S = 0.02
"""Time without a reading after which the handle is engaged again from its present position [s]."""
SMOOTHING_S = 0.002
"""Time constant of the velocity filter for devices that do not measure velocity [s]."""


class ForceLimiter:
    """Limits the magnitude and the slew rate of forces.

    The direction of a force stays unchanged, so a braking force still brakes. A force may decrease at any rate.

    Args:
        max_force_n: Force limit [N].
        slew_n_per_s: Largest rate at which a force may grow [N/s].

    Attributes:
        not_finite: Number of forces refused because a component was not finite.
    """

    def __init__(self, max_force_n: float, slew_n_per_s: float) -> None:
        self._max_force_n, self._slew = max_force_n, slew_n_per_s
        self._last = ZERO
        self.not_finite = 0

    def limited(self, force: Vector, dt_s: float) -> Vector:
        """Returns the limited force [N], which is zero if `force` is not finite.

        `dt_s` is the time since the last call [s].
        """
        length = norm(force)
        if not math.isfinite(length):
            self.not_finite += 1
            self._last = ZERO
            return ZERO
        if length == 0.0:
            self._last = ZERO
            return ZERO
        before = max(dot(self._last, force) / length, 0.0)
        most = min(self._max_force_n, before + self._slew * dt_s)
        self._last = force if length <= most else scaled(most / length, force)
        return self._last

    def note(self, force: Vector) -> None:
        """Sets the force that was finally sent [N]. The growth of the next force is limited relative to this force."""
        self._last = force


class Snapshot(NamedTuple):
    """Result of the controller for one reading of the device.

    Attributes:
        reading: The reading.
        velocity: Velocity of the handle, in the device's axes [m/s].
        deviation: Displacement of the handle since it was engaged, in the device's axes [m]; 0 while disengaged.
        displacement: Displacement of the target from its start, in the tool's axes [m].
        force: Force that is sent to the device, in the device's axes [N].
        is_engaged: Whether handle and tool are coupled.
        time_s: Time of the reading, by the monotonic clock [s].
    """

    reading: HapticReading
    velocity: Vector
    deviation: Vector
    displacement: Vector
    force: Vector
    is_engaged: bool
    time_s: float


class HapticController:
    """Computes the target of the tool and the force on the handle.

    The inputs are readings of the handle, and the force or the displacement of the tool in the simulator. A force
    passes four stages: the coupling, the damper of the passivity controller, the limits of force and slew rate, and a
    final check of passivity.

    Args:
        config: Parameters of the mapping and the forces.
        device: Properties of the device.
        sample_hz: Rate at which the device is read [Hz].
        displacement: Initial displacement of the target from its start, in the tool's axes [m].

    Attributes:
        force: Force that is sent to the device now, in the device's axes [N].
        fault: Fault of the last reading; empty if the last reading was valid.
        faults: Number of refused readings, keyed by fault.
        snapshot: Result for the last valid reading; None before the first valid reading.
        stiffness_bound: Stiffness up to which a virtual wall is passive without the passivity controller [N/m].
    """

    def __init__(
        self, config: ForceFeedbackConfig, device: HapticConfig, sample_hz: float, displacement: Vector = ZERO
    ) -> None:
        self._config, self._max_force_n = config, device.max_force_n
        self.coupling = VirtualCoupling(
            config.mode, config.stiffness, config.damping, config.force_scale, config.expiry_s
        )
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
        self._target = TargetFollower(config.motion_scale, config.way_low, config.way_high, config.max_target_speed)
        self._yaw = math.radians(config.yaw_deg)
        self._target.displacement = displacement
        self._clutch.set_displacement(self._handle_displacement(displacement))
        self._period_s = 1.0 / sample_hz
        self.force: Vector = ZERO
        self.fault = ""
        self.faults: dict[str, int] = {}
        self.snapshot: Snapshot | None = None
        self._position: Vector | None = None
        self._velocity = ZERO
        self._seen_s = -math.inf
        self._tool_displacement: Vector | None = None
        self.awaits_reset = False

    def observe_wrench(self, force: Vector, now_s: float, delay_s: float = 0.0) -> None:
        """Updates the force on the tool [N], finite and in the tool's axes. `delay_s` is the age of the force [s]."""
        if self._config.mode == "wrench":
            self.coupling.observe(turned_about_z(force, -self._yaw), now_s, delay_s)

    def observe_tool(self, displacement: Vector, now_s: float, delay_s: float = 0.0) -> None:
        """Updates the tool's displacement from its start, in the tool's axes [m], measured `delay_s` [s] ago."""
        if self._config.mode == "coupling":
            self._tool_displacement = self._handle_displacement(displacement)
            self.coupling.observe(self._tool_displacement, now_s, delay_s)

    def reset(self) -> None:
        """Makes the target move back to its start, from where the target follows the handle again."""
        self.awaits_reset = True

    def lose(self) -> None:
        """Sets the force to zero and disengages the handle, after the device has disconnected."""
        self._drop()
        self._clutch.release()
        self._check.forget()
        self._position = None

    def tick(self, now_s: float, reading: HapticReading | None) -> Vector:
        """Processes a reading, and returns the force for the device, in the device's axes [N].

        Args:
            now_s: Present time, by the monotonic clock [s].
            reading: Reading since the last tick; None without a new reading.
        """
        if reading is not None:
            try:
                self._process(self._check.checked(reading, now_s), now_s)
            except ReadingError as error:
                self.refuse(error)
            else:
                self.fault = ""
                return self.force
        if now_s - self._seen_s > self._config.expiry_s or self.coupling.freshness(now_s) == 0.0:
            self._drop()
        return self.force

    def refuse(self, error: ReadingError) -> None:
        """Records and counts the fault of an invalid reading."""
        self.fault = f"{error.fault}: {error}"
        self.faults[error.fault] = self.faults.get(error.fault, 0) + 1

    @property
    def not_finite(self) -> int:
        """Number of forces refused because a component was not finite."""
        return self._limiter.not_finite

    def _drop(self) -> None:
        if self.force != ZERO:
            self.passivity.cut()
            self._limiter.note(ZERO)
            self.force = ZERO

    def _process(self, reading: HapticReading, now_s: float) -> None:
        """Updates the force, the target and the snapshot with one valid reading."""
        position, dt_s = reading.position, now_s - self._seen_s
        was_away = self._position is None or self._check.has_moved or dt_s > SILENCE_S
        step = ZERO if self._position is None or self._check.has_moved else minus(position, self._position)
        if was_away:
            self._drop()
            self._clutch.release()
            self._velocity = ZERO
            dt_s = self._period_s
        self.passivity.observe(step)
        velocity = ZERO if was_away else scaled(1.0 / dt_s, step)  # mean over the period, for passivity
        self._velocity = reading.velocity if reading.velocity is not None else self._smoothed(velocity, dt_s)
        self._position, self._seen_s = position, now_s
        self._engage(position, reading.buttons, now_s)
        force = ZERO
        if self._clutch.engaged:
            force = self.coupling.force(self._clutch.displacement, self._velocity, now_s)
            axes = self._config.force_axes
            force = force[0] * axes[0], force[1] * axes[1], force[2] * axes[2]
            force = self._limiter.limited(self.passivity.damped(force, velocity), dt_s)
        self.force = self.passivity.hold(force, velocity)
        self._limiter.note(self.force)
        self.snapshot = Snapshot(
            reading,
            self._velocity,
            self._clutch.deviation,
            self._target.follow(turned_about_z(self._clutch.displacement, self._yaw), dt_s),
            self.force,
            self._clutch.engaged,
            now_s,
        )

    def _handle_displacement(self, displacement: Vector) -> Vector:
        """Converts a displacement of the tool to a displacement of the handle [m]. Axes with motion scale 0 get 0."""
        x, y, z = (part / scale if scale else 0.0 for part, scale in zip(displacement, self._config.motion_scale))
        return turned_about_z((x, y, z), -self._yaw)

    def _engage(self, position: Vector, buttons: tuple[int, ...], now_s: float) -> None:
        if self.awaits_reset:
            self.awaits_reset = False
            self._clutch.set_displacement(ZERO)
        if self.coupling.freshness(now_s) == 0.0 and self._config.mode == "coupling":
            self._clutch.release()  # otherwise the spring would be stretched when the tool is back
        if self._clutch.update(position, buttons):
            self.passivity.reset()
            if self._tool_displacement is not None:
                self._clutch.set_displacement(self._tool_displacement)
                self._clutch.update(position, buttons)

    def _smoothed(self, velocity: Vector, dt_s: float) -> Vector:
        share = dt_s / (SMOOTHING_S + dt_s)
        return plus(scaled(1.0 - share, self._velocity), scaled(share, velocity))
