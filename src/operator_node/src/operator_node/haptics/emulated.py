"""Simulates a hand on a handle as a mass on a spring. Contains the base class of haptic devices without hardware."""

import time
from abc import abstractmethod
from typing import NamedTuple

from robot_model.geometry import ZERO, Vector, minus, scaled, shortened_to

from .device import HapticDevice, HapticReading

STEP_S = 0.001
MAX_STEP_S = 0.05
"""Longest time that one call simulates [s]. The rest of a longer time is skipped without motion of the handle."""


class Hand:
    """Simulates a hand that holds a device's handle. Hand and handle move together as one mass.

    Two forces act on the mass: the hand pulls towards a goal like a spring and a damper, and the device adds its force.

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
        """Largest acceleration that the hand causes [m/s^2]. The device's force causes a further acceleration."""
        return self._max_force_n / self._mass

    def step(self, goal: Vector, force: Vector, dt_s: float) -> None:
        """Integrates one step (semi-implicit Euler).

        Args:
            goal: Position to which the hand pulls the handle [m].
            force: Force of the device [N].
            dt_s: Length of the step [s].
        """
        pull = shortened_to(
            minus(scaled(self._stiffness, minus(goal, self.position)), scaled(self._damping, self.velocity)),
            self._max_force_n,
        )
        k = dt_s / self._mass
        v, p = self.velocity, self.position
        v = v[0] + (pull[0] + force[0]) * k, v[1] + (pull[1] + force[1]) * k, v[2] + (pull[2] + force[2]) * k
        self.velocity = v
        self.position = p[0] + v[0] * dt_s, p[1] + v[1] * dt_s, p[2] + v[2] * dt_s


class PressMotion(NamedTuple):
    """Motion of a hand that moves down along z, waits, and moves back up. The motion is smooth, from rest to rest.

    Attributes:
        depth_m: Depth of the motion [m].
        wait_s: Time at the top before the motion, and again after it [s].
        move_s: Duration of each motion [s].
        hold_s: Time at the bottom [s].
    """

    depth_m: float
    wait_s: float = 0.5
    move_s: float = 1.5
    hold_s: float = 1.5

    @property
    def duration_s(self) -> float:
        """Duration of the whole motion [s]."""
        return 2.0 * (self.wait_s + self.move_s) + self.hold_s

    def goal(self, time_s: float) -> Vector:
        """Returns the position to which the hand pulls the handle [m], `time_s` [s] after the start of the motion."""
        ahead_s = min(time_s - self.wait_s, self.duration_s - self.wait_s - time_s)
        s = min(max(ahead_s / self.move_s, 0.0), 1.0)
        return 0.0, 0.0, -self.depth_m * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)  # minimum jerk


class EmulatedDevice(HapticDevice):
    """Base class of devices with a simulated handle, which a hand pulls to a goal. The simulation runs in real time."""

    hand: Hand
    buttons: tuple[int, ...] = ()

    @abstractmethod
    def goal(self, time_s: float) -> Vector:
        """Returns the position to which the hand pulls the handle [m], `time_s` [s] after `open`."""

    def open(self) -> None:
        """Starts the simulation with the handle at rest in the middle of the workspace."""
        self.hand = self.make_hand()
        self._start_s = self._now_s = time.monotonic()
        self._force, self._expires_s = ZERO, 0.0

    def make_hand(self) -> Hand:
        """Returns a new hand, at rest in the middle of the workspace."""
        return Hand()

    @property
    def force(self) -> Vector:
        """Force on the handle now [N]; zero after the force has expired."""
        return self._force if self._now_s < self._expires_s else ZERO

    def read(self) -> HapticReading | None:
        """Simulates the time since the last call, and returns the handle's state.

        Returns None if less than half a `STEP_S` has passed since the last call.
        """
        now_s = time.monotonic()
        self._now_s = max(self._now_s, now_s - MAX_STEP_S)
        if now_s - self._now_s < 0.5 * STEP_S:
            return None
        while (left_s := now_s - self._now_s) > 1e-9:
            step_s = left_s if left_s < 1.5 * STEP_S else STEP_S
            self._now_s += step_s
            self.hand.step(self.goal(self._now_s - self._start_s), self.force, step_s)
        return HapticReading(self.hand.position, self.hand.velocity, buttons=self.buttons)

    def send(self, force: Vector, expires_s: float) -> None:
        """Applies a force to the handle until it expires."""
        self._force, self._expires_s = force, expires_s

    def close(self) -> None:
        """Removes the force."""
        self._force = ZERO
