"""Coupling between handle and tool: displacement by a clutch, force by a spring and a damper."""

from collections.abc import Sequence
from typing import Literal, NamedTuple

from robot_model.geometry import ZERO, Vector, minus, norm, plus, scaled

Mode = Literal["wrench", "coupling"]


class Clutch:
    """Couples displacements: after engaging, the tool moves with the handle, from the present positions of both.

    Args:
        button: Index of the button that has to be held; None couples all the time.

    Attributes:
        engaged: Whether they are coupled.
        deviation: Displacement of the handle since it was engaged [m].
    """

    def __init__(self, button: int | None = None) -> None:
        self._button = button
        self.engaged = False
        self._kept = self._reference = self.deviation = ZERO

    @property
    def displacement(self) -> Vector:
        """Displacement of the tool since the start, in metres of the handle."""
        return plus(self._kept, self.deviation)

    def update(self, position: Vector, buttons: Sequence[int]) -> bool:
        """Updates the position of the handle [m]; returns whether it was engaged just now."""
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
        """Disengages: the tool keeps its position. While the button is held, the next update engages again."""
        self._kept, self.deviation, self.engaged = self.displacement, ZERO, False

    def set_displacement(self, displacement: Vector) -> None:
        """Sets the displacement of the tool [m] and disengages; the next motion of the handle continues from it."""
        self._kept, self.engaged, self.deviation = displacement, False, ZERO


class TargetFollower:
    """Target of the tool: it follows the handle up to a largest speed, and stays in a box.

    Args:
        scale: Displacement of the tool for each metre of the handle, by axis; 0 holds an axis.
        low: Least displacement from the start, by axis [m].
        high: Largest displacement from the start, by axis [m].
        max_speed: Largest speed [m/s].
    """

    def __init__(self, scale: Vector, low: Vector, high: Vector, max_speed: float) -> None:
        self._scale, self._low, self._high, self._max_speed = scale, low, high, max_speed
        self.displacement: Vector = ZERO

    def follow(self, displacement: Vector, dt_s: float) -> Vector:
        """Returns the displacement of the tool from the start [m], `dt_s` after the last call."""
        x, y, z = (value * scale for value, scale in zip(displacement, self._scale))
        goal = self.limited((x, y, z))
        step = minus(goal, self.displacement)
        length, most = norm(step), self._max_speed * dt_s
        self.displacement = goal if length <= most else plus(self.displacement, scaled(most / length, step))
        return self.displacement

    def limited(self, displacement: Vector) -> Vector:
        """Returns a displacement clipped to the box."""
        (ax, ay, az), (bx, by, bz) = self._low, self._high
        return min(max(displacement[0], ax), bx), min(max(displacement[1], ay), by), min(max(displacement[2], az), bz)


def stiffest_n_per_m(device_damping: float, coupling_damping: float, period_s: float) -> float:
    """Returns the stiffness up to which a virtual wall is passive by itself; 0 if there is none.

    K < 2 (b - |B|) / T, with the damping b of the device and the hand that holds it, B of the wall, and the sample time
    T (J. E. Colgate and G. G. Schenkel, "Passivity of a class of sampled-data systems: application to haptic
    interfaces", J. Robotic Systems 14(1), 1997).

    Args:
        device_damping: b [N s/m].
        coupling_damping: B [N s/m].
        period_s: T [s].
    """
    return max(0.0, 2.0 * (device_damping - abs(coupling_damping)) / period_s)


class ToolSample(NamedTuple):
    """Last sample of the tool from the simulator, in the axes of the device.

    Attributes:
        value: Force on the tool [N], or its displacement in metres of the handle [m].
        rate: Rate of change of the displacement [m/s].
        arrived_s: Time of arrival, by the monotonic clock [s].
        delay_s: Age of the sample at arrival [s].
    """

    value: Vector
    rate: Vector
    arrived_s: float
    delay_s: float


class VirtualCoupling:
    """Virtual coupling between handle and tool (J. E. Colgate, M. C. Stanley and J. M. Brown, "Issues in the haptic
    display of tool use", IROS 1995): samples of a slow simulator act through a spring and a damper that are computed at
    the rate of the device, so that device and simulator are each passive.

    In the mode `wrench`, the force on the tool is rendered as it is, and the damper brakes the handle alone.

    A sample is valid for `expiry_s`; during the second half of that time its effect fades to zero.

    Args:
        mode: `coupling`, or `wrench`.
        stiffness: Stiffness of the spring [N/m].
        damping: Damping of the damper [N s/m].
        force_scale: Factor of forces in the mode `wrench`.
        expiry_s: Time for which a sample is valid [s].
    """

    def __init__(self, mode: Mode, stiffness: float, damping: float, force_scale: float, expiry_s: float) -> None:
        self._mode, self._stiffness, self._damping = mode, stiffness, damping
        self._force_scale, self._expiry_s = force_scale, expiry_s
        self._last: ToolSample | None = None

    def observe(self, value: Vector, now_s: float, delay_s: float = 0.0) -> None:
        """Stores a sample of the simulator, finite and in the axes of the device."""
        last, rate = self._last, ZERO
        if self._mode == "coupling" and last is not None and last.arrived_s < now_s < last.arrived_s + self._expiry_s:
            rate = scaled(1.0 / (now_s - last.arrived_s), minus(value, last.value))
        self._last = ToolSample(value, rate, now_s, delay_s)

    def forget(self) -> None:
        """Drops the last sample."""
        self._last = None

    def delay_s(self, now_s: float) -> float:
        """Returns the age of the sample that is rendered [s]; infinite without any."""
        last = self._last
        return float("inf") if last is None else now_s - last.arrived_s + last.delay_s

    def freshness(self, now_s: float) -> float:
        """Returns the weight of the last sample: 1, decreasing in the second half of its time, then 0."""
        last = self._last
        if last is None:
            return 0.0
        left = 2.0 - 2.0 * (now_s - last.arrived_s) / self._expiry_s
        return min(max(left, 0.0), 1.0)

    def force(self, position: Vector, velocity: Vector, now_s: float) -> Vector:
        """Returns the force to render [N].

        Args:
            position: Displacement of the handle since it was engaged [m].
            velocity: Velocity of the handle [m/s].
            now_s: By the monotonic clock [s].
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
