"""Couples handle and tool. A clutch passes displacements to the tool; spring and damper pass forces to the handle."""

from collections.abc import Sequence
from typing import Literal, NamedTuple

from robot_model.geometry import ZERO, Vector, minus, norm, plus, scaled

Mode = Literal["wrench", "coupling"]


class Clutch:
    """Couples handle and tool. While the clutch is engaged, the tool moves by the displacement of the handle.

    Args:
        button: Index of the button that must be held to engage the clutch; None: the clutch is always engaged.

    Attributes:
        engaged: Whether handle and tool are coupled.
        deviation: Displacement of the handle since it was engaged [m]; 0 while disengaged.
    """

    def __init__(self, button: int | None = None) -> None:
        self._button = button
        self.engaged = False
        self._kept = self._reference = self.deviation = ZERO

    @property
    def displacement(self) -> Vector:
        """Displacement of the tool since the start, before the motion scale is applied [m]."""
        return plus(self._kept, self.deviation)

    def update(self, position: Vector, buttons: Sequence[int]) -> bool:
        """Updates the clutch from the handle's position [m] and buttons. Returns True if this call engaged it."""
        is_held = self._button is None or (self._button < len(buttons) and bool(buttons[self._button]))
        if is_held and not self.engaged:
            self.engaged, self._reference, self.deviation = True, position, ZERO
            return True
        if not is_held:
            self.release()
        elif self.engaged:
            self.deviation = minus(position, self._reference)
        return False

    def release(self) -> None:
        """Disengages the clutch; the tool stays. If the button is held, the next update engages the clutch again."""
        self._kept, self.deviation, self.engaged = self.displacement, ZERO, False

    def set_displacement(self, displacement: Vector) -> None:
        """Disengages the clutch, and sets the tool's displacement before the motion scale is applied [m]."""
        self._kept, self.engaged, self.deviation = displacement, False, ZERO


class TargetFollower:
    """Moves the target of the tool after the handle, at a limited speed and within a box-shaped workspace.

    Args:
        scale: Displacement of the tool per metre of the handle's displacement, for each axis; 0 fixes an axis.
        low: Smallest displacement from the start for each axis [m].
        high: Largest displacement from the start for each axis [m].
        max_speed: Largest speed of the target [m/s].
    """

    def __init__(self, scale: Vector, low: Vector, high: Vector, max_speed: float) -> None:
        self._scale, self._low, self._high, self._max_speed = scale, low, high, max_speed
        self.displacement: Vector = ZERO

    def follow(self, displacement: Vector, dt_s: float) -> Vector:
        """Moves the target towards the scaled displacement of the handle. Returns the target's displacement [m].

        Args:
            displacement: Displacement of the handle, in the tool's axes [m].
            dt_s: Time since the last call [s].
        """
        x, y, z = (value * scale for value, scale in zip(displacement, self._scale))
        goal = self.limited((x, y, z))
        step = minus(goal, self.displacement)
        length, most = norm(step), self._max_speed * dt_s
        self.displacement = goal if length <= most else plus(self.displacement, scaled(most / length, step))
        return self.displacement

    def limited(self, displacement: Vector) -> Vector:
        """Clips a displacement of the target to the workspace [m]."""
        (ax, ay, az), (bx, by, bz) = self._low, self._high
        return min(max(displacement[0], ax), bx), min(max(displacement[1], ay), by), min(max(displacement[2], az), bz)


def stiffest_n_per_m(device_damping: float, coupling_damping: float, period_s: float) -> float:
    """Returns the stiffness K up to which a virtual wall is passive [N/m]; 0 if no wall is passive.

    K < 2 (b - |B|) / T (J. E. Colgate and G. G. Schenkel, "Passivity of a class of sampled-data systems: application to
    haptic interfaces", J. Robotic Systems 14(1), 1997).

    Args:
        device_damping: Damping b of the device together with the hand [N s/m].
        coupling_damping: Damping B of the wall [N s/m].
        period_s: Sample time T [s].
    """
    return max(0.0, 2.0 * (device_damping - abs(coupling_damping)) / period_s)


class ToolSample(NamedTuple):
    """Sample of the tool's force or displacement from the simulator, in the device's axes.

    Attributes:
        value: Force on the tool [N], or displacement of the tool divided by the motion scale [m].
        rate: Rate of change of the displacement [m/s].
        arrived_s: Time of arrival, by the monotonic clock [s].
        delay_s: Age of the sample at arrival [s].
    """

    value: Vector
    rate: Vector
    arrived_s: float
    delay_s: float


class VirtualCoupling:
    """Virtual coupling between handle and tool by a spring and a damper.

    The spring and the damper are computed at the rate of the device, also with samples of a slower simulator. Device
    and simulator can then each be passive (J. E. Colgate, M. C. Stanley and J. M. Brown, "Issues in the haptic display
    of tool use", IROS 1995). In the mode `wrench`, the force on the tool replaces the spring, and the damper brakes the
    handle.

    A sample is valid for `expiry_s`. During the second half of this time, its effect fades to zero.

    Args:
        mode: `coupling` or `wrench`.
        stiffness: Stiffness of the spring [N/m].
        damping: Damping coefficient of the damper [N s/m].
        force_scale: Factor from the force on the tool to the rendered force, in the mode `wrench`.
        expiry_s: Time for which a sample is valid [s].
    """

    def __init__(self, mode: Mode, stiffness: float, damping: float, force_scale: float, expiry_s: float) -> None:
        self._mode, self._stiffness, self._damping = mode, stiffness, damping
        self._force_scale, self._expiry_s = force_scale, expiry_s
        self._last: ToolSample | None = None

    def observe(self, value: Vector, now_s: float, delay_s: float = 0.0) -> None:
        """Stores a sample of the tool.

        Args:
            value: Force on the tool [N], or displacement of the tool divided by the motion scale [m]; both finite and
                in the device's axes.
            now_s: Time of arrival, by the monotonic clock [s].
            delay_s: Age of the sample at arrival [s].
        """
        last, rate = self._last, ZERO
        if self._mode == "coupling" and last is not None and last.arrived_s < now_s < last.arrived_s + self._expiry_s:
            rate = scaled(1.0 / (now_s - last.arrived_s), minus(value, last.value))
        self._last = ToolSample(value, rate, now_s, delay_s)

    def forget(self) -> None:
        """Drops the last sample."""
        self._last = None

    def delay_s(self, now_s: float) -> float:
        """Returns the age of the sample that is rendered [s]; infinite without a sample."""
        last = self._last
        return float("inf") if last is None else now_s - last.arrived_s + last.delay_s

    def freshness(self, now_s: float) -> float:
        """Returns the weight of the last sample. It is 1 at first, and falls to 0 in the second half of `expiry_s`."""
        last = self._last
        if last is None:
            return 0.0
        left = 2.0 - 2.0 * (now_s - last.arrived_s) / self._expiry_s
        return min(max(left, 0.0), 1.0)

    def force(self, position: Vector, velocity: Vector, now_s: float) -> Vector:
        """Returns the force to render, in the device's axes [N].

        Args:
            position: Value of `Clutch.displacement` [m].
            velocity: Velocity of the handle [m/s].
            now_s: Present time, by the monotonic clock [s].
        """
        share, last = self.freshness(now_s), self._last
        if share == 0.0 or last is None:
            return ZERO
        value, rate = last.value, last.rate
        if self._mode == "wrench":
            k, b = self._force_scale * share, self._damping * share
            return value[0] * k - velocity[0] * b, value[1] * k - velocity[1] * b, value[2] * k - velocity[2] * b
        k, b = self._stiffness * share, self._damping * share
        return (
            k * (value[0] - position[0]) + b * (rate[0] - velocity[0]),
            k * (value[1] - position[1]) + b * (rate[1] - velocity[1]),
            k * (value[2] - position[2]) + b * (rate[2] - velocity[2]),
        )
