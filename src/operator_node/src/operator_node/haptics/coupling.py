"""What the person is to feel of the tool: the force that it measures, or a spring and a damper to where it is."""

from typing import Literal, NamedTuple

from rpbi.geometry import Vector, minus, scaled

from .vectors import ZERO

Mode = Literal["wrench", "coupling"]


def stiffest_n_per_m(device_damping: float, coupling_damping: float, period_s: float) -> float:
    """Returns the stiffness up to which a virtual wall is passive by itself; 0 if there is none.

    K < 2 (b - |B|) / T, with the damping b of the device and what holds it, B of the wall, and the sample time T
    (J. E. Colgate and G. G. Schenkel, "Passivity of a class of sampled-data systems: application to haptic interfaces",
    J. Robotic Systems 14(1), 1997).

    Args:
        device_damping: b [N s/m].
        coupling_damping: B [N s/m].
        period_s: T [s].
    """
    return max(0.0, 2.0 * (device_damping - abs(coupling_damping)) / period_s)


class ToolSample(NamedTuple):
    """What the simulator said last of the tool, in the axes of the device.

    Attributes:
        value: Force on the tool [N], or its position on the way of the handle [m].
        rate: How fast the position changes [m/s].
        arrived_s: When it came, by the monotonic clock [s].
        delay_s: How old it was then [s].
    """

    value: Vector
    rate: Vector
    arrived_s: float
    delay_s: float


class Coupling:
    """Between the handle and the tool (J. E. Colgate, M. C. Stanley and J. M. Brown, "Issues in the haptic display of
    tool use", IROS 1995): what comes from a slow simulator acts by a spring and a damper that are computed at the rate
    of the device, so that device and simulator are passive each for itself.

    In the mode `wrench` the force on the tool is felt as it is, and the damper is one against the room.

    What came last counts for some time; in the second half of it, it fades to nothing.

    Args:
        mode: `coupling`, or `wrench`.
        stiffness: Of the spring [N/m].
        damping: Of the damper [N s/m].
        force_scale: What forces of the mode `wrench` are multiplied by.
        expiry_s: How long what came last counts [s].
    """

    def __init__(self, mode: Mode, stiffness: float, damping: float, force_scale: float, expiry_s: float) -> None:
        self._mode, self._stiffness, self._damping = mode, stiffness, damping
        self._force_scale, self._expiry_s = force_scale, expiry_s
        self._last: ToolSample | None = None

    def take(self, value: Vector, now_s: float, delay_s: float = 0.0) -> None:
        """Takes what the simulator says, finite and in the axes of the device; another thread may call it."""
        last, rate = self._last, ZERO
        if self._mode == "coupling" and last is not None and last.arrived_s < now_s < last.arrived_s + self._expiry_s:
            rate = scaled(1.0 / (now_s - last.arrived_s), minus(value, last.value))
        self._last = ToolSample(value, rate, now_s, delay_s)

    def forget(self) -> None:
        """Lets what came last count no more."""
        self._last = None

    def delay_s(self, now_s: float) -> float:
        """Returns how old what is felt is [s]; infinite without any."""
        last = self._last
        return float("inf") if last is None else now_s - last.arrived_s + last.delay_s

    def freshness(self, now_s: float) -> float:
        """Returns how much what came last counts: 1, less in the second half of its time, then 0."""
        last = self._last
        if last is None:
            return 0.0
        left = 2.0 - 2.0 * (now_s - last.arrived_s) / self._expiry_s
        return min(max(left, 0.0), 1.0)

    def force(self, position: Vector, velocity: Vector, now_s: float) -> Vector:
        """Returns what the person is to feel [N].

        Args:
            position: Of the handle since it was engaged [m].
            velocity: Of the handle [m/s].
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
