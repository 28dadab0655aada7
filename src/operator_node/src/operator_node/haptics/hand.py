"""A hand on a handle, modelled as a mass on a spring, for emulated devices and experiments."""

from typing import NamedTuple

from robot_model.geometry import ZERO, Vector, minus, scaled, shortened_to


class Hand:
    """A handle with a mass that a hand pulls to a wanted position, while the device pushes.

    Args:
        mass: Mass of handle and hand [kg].
        stiffness: Stiffness of the hand's grip [N/m].
        damping: Damping of grip and arm [N s/m].
        max_force_n: Largest force of the hand [N].

    Attributes:
        position: Position of the handle [m].
        velocity: Velocity of the handle [m/s].
    """

    def __init__(
        self, mass: float = 0.3, stiffness: float = 300.0, damping: float = 12.0, max_force_n: float = 20.0
    ) -> None:
        self._mass, self._stiffness, self._damping, self._max_force_n = mass, stiffness, damping, max_force_n
        self.position = self.velocity = ZERO

    @property
    def max_acceleration(self) -> float:
        """Largest acceleration from the hand alone [m/s^2]; that from the device's force adds to it."""
        return self._max_force_n / self._mass

    def step(self, wanted: Vector, force: Vector, dt_s: float) -> None:
        """Integrates one step (semi-implicit Euler).

        Args:
            wanted: Position to which the hand pulls the handle [m].
            force: Force of the device [N].
            dt_s: Length of the step [s].
        """
        pull = shortened_to(
            minus(scaled(self._stiffness, minus(wanted, self.position)), scaled(self._damping, self.velocity)),
            self._max_force_n,
        )
        k = dt_s / self._mass
        v, p = self.velocity, self.position
        v = v[0] + (pull[0] + force[0]) * k, v[1] + (pull[1] + force[1]) * k, v[2] + (pull[2] + force[2]) * k
        self.velocity = v
        self.position = p[0] + v[0] * dt_s, p[1] + v[1] * dt_s, p[2] + v[2] * dt_s


class PressMotion(NamedTuple):
    """A hand that moves down along z, stays there for a while and comes back, smoothly and from rest to rest.

    Attributes:
        depth_m: Depth of the motion [m].
        wait_s: Time that it stays above at first, and again at the end [s].
        move_s: Duration of each motion [s].
        hold_s: Time that it stays below [s].
    """

    depth_m: float
    wait_s: float = 0.5
    move_s: float = 1.5
    hold_s: float = 1.5

    @property
    def duration_s(self) -> float:
        """Duration of the whole motion [s]."""
        return 2.0 * (self.wait_s + self.move_s) + self.hold_s

    def wanted(self, time_s: float) -> Vector:
        """Returns the position to which the hand pulls the handle, some time after its start [m]."""
        ahead_s = min(time_s - self.wait_s, self.duration_s - self.wait_s - time_s)
        s = min(max(ahead_s / self.move_s, 0.0), 1.0)
        return 0.0, 0.0, -self.depth_m * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)  # minimum jerk
