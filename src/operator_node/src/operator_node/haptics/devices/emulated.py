"""Base of devices without hardware: a hand on a handle, which the force moves, too."""

import time
from abc import abstractmethod

from operator_node.haptics.device import HapticDevice, HapticReading
from operator_node.haptics.hand import Hand
from robot_model.geometry import ZERO, Vector

STEP_S = 0.001
MAX_STEP_S = 0.05
"""Longest time that is simulated at once [s]; the rest is dropped, and the handle stands still meanwhile."""


class EmulatedDevice(HapticDevice):
    """A handle that a hand pulls to a wanted position and the force pushes; its time is the monotonic clock."""

    hand: Hand
    buttons: tuple[int, ...] = ()

    @abstractmethod
    def wanted(self, time_s: float) -> Vector:
        """Returns the position to which the hand pulls the handle, some time after `open` [m]."""

    def open(self) -> None:
        """Starts with the handle at rest in the middle."""
        self.hand = self.make_hand()
        self._start_s = self._now_s = time.monotonic()
        self._force, self._expires_s = ZERO, 0.0

    def make_hand(self) -> Hand:
        """Returns the hand, at rest in the middle."""
        return Hand()

    @property
    def force(self) -> Vector:
        """Force that is rendered now [N]."""
        return self._force if self._now_s < self._expires_s else ZERO

    def read(self) -> HapticReading | None:
        """Simulates the time since the last call, and returns the handle's state."""
        now_s = time.monotonic()
        self._now_s = max(self._now_s, now_s - MAX_STEP_S)
        if now_s - self._now_s < 0.5 * STEP_S:
            return None
        while (left_s := now_s - self._now_s) > 1e-9:
            step_s = left_s if left_s < 1.5 * STEP_S else STEP_S
            self._now_s += step_s
            self.hand.step(self.wanted(self._now_s - self._start_s), self.force, step_s)
        return HapticReading(self.hand.position, self.hand.velocity, buttons=self.buttons)

    def send(self, force: Vector, expires_s: float) -> None:
        """Applies a force to the handle until it expires."""
        self._force, self._expires_s = force, expires_s

    def close(self) -> None:
        """Removes the force."""
        self._force = ZERO
