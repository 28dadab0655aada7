"""A hand on a handle, as a mass on a spring: for devices that are only emulated, and for experiments."""

from typing import NamedTuple

from rpbi.geometry import Vector, minus, scaled

from .vectors import ZERO, within


class Hand:
    """A handle of some mass that a hand draws to where it wants it, while the device pushes.

    Args:
        mass: Of handle and hand [kg].
        stiffness: Of the hand's grip [N/m].
        damping: Of grip and arm [N s/m].
        max_force_n: The hand's largest force [N].

    Attributes:
        position: Of the handle [m].
        velocity: [m/s].
    """

    def __init__(
        self, mass: float = 0.3, stiffness: float = 300.0, damping: float = 12.0, max_force_n: float = 20.0
    ) -> None:
        self._mass, self._stiffness, self._damping, self._max_force_n = mass, stiffness, damping, max_force_n
        self.position = self.velocity = ZERO

    @property
    def max_acceleration(self) -> float:
        """The hand's own largest acceleration [m/s^2]; that of the device's force comes on top."""
        return self._max_force_n / self._mass

    def step(self, wanted: Vector, force: Vector, dt_s: float) -> None:
        """Goes on in time (semi-implicit Euler).

        Args:
            wanted: Where the hand wants the handle [m].
            force: What the device pushes with [N].
            dt_s: For how long [s].
        """
        pull = within(
            minus(scaled(self._stiffness, minus(wanted, self.position)), scaled(self._damping, self.velocity)),
            self._max_force_n,
        )
        k = dt_s / self._mass
        v, p = self.velocity, self.position
        v = v[0] + (pull[0] + force[0]) * k, v[1] + (pull[1] + force[1]) * k, v[2] + (pull[2] + force[2]) * k
        self.velocity = v
        self.position = p[0] + v[0] * dt_s, p[1] + v[1] * dt_s, p[2] + v[2] * dt_s


class Press(NamedTuple):
    """A hand that goes down along z, stays there for a while and comes back, smoothly and from rest to rest.

    Attributes:
        depth_m: How far down [m].
        wait_s: How long it stays above at first, and again at the end [s].
        move_s: How long each way takes [s].
        hold_s: How long it stays below [s].
    """

    depth_m: float
    wait_s: float = 0.5
    move_s: float = 1.5
    hold_s: float = 1.5

    @property
    def duration_s(self) -> float:
        """How long all of it takes [s]."""
        return 2.0 * (self.wait_s + self.move_s) + self.hold_s

    def wanted(self, time_s: float) -> Vector:
        """Returns where the hand wants the handle, some time after its start [m]."""
        ahead_s = min(time_s - self.wait_s, self.duration_s - self.wait_s - time_s)
        s = min(max(ahead_s / self.move_s, 0.0), 1.0)
        return 0.0, 0.0, -self.depth_m * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)  # least jerk
