"""What devices without hardware share: a hand on a handle, which the force moves as well."""

import time
from abc import abstractmethod

from operator_node.haptics.device import HapticDevice, HapticReading
from operator_node.haptics.hand import Hand
from operator_node.haptics.vectors import ZERO
from rpbi.geometry import Vector

STEP_S = 0.001
LONGEST_S = 0.05
"""Time beyond this is lost: the handle stands still meanwhile [s]."""


class EmulatedDevice(HapticDevice):
    """A handle that is drawn to where a hand wants it, and pushed by the force; time is the monotonic clock."""

    hand: Hand
    buttons: tuple[int, ...] = ()

    @abstractmethod
    def wanted(self, time_s: float) -> Vector:
        """Returns where the hand wants the handle, some time after `open` [m]."""

    def open(self) -> None:
        """Takes hold of the handle, at rest in the middle."""
        self.hand = self.make_hand()
        self._start_s = self._now_s = time.monotonic()
        self._force, self._expires_s = ZERO, 0.0

    def make_hand(self) -> Hand:
        """Returns the hand, at rest in the middle."""
        return Hand()

    @property
    def force(self) -> Vector:
        """The force that is felt now [N]."""
        return self._force if self._now_s < self._expires_s else ZERO

    def read(self) -> HapticReading | None:
        """Lets the time since the last call pass, and returns where the handle is then."""
        now_s = time.monotonic()
        self._now_s = max(self._now_s, now_s - LONGEST_S)
        if now_s - self._now_s < 0.5 * STEP_S:
            return None
        while (left_s := now_s - self._now_s) > 1e-9:
            step_s = left_s if left_s < 1.5 * STEP_S else STEP_S
            self._now_s += step_s
            self.hand.step(self.wanted(self._now_s - self._start_s), self.force, step_s)
        return HapticReading(self.hand.position, self.hand.velocity, buttons=self.buttons)

    def send(self, force: Vector, expires_s: float) -> None:
        """Has the handle be pushed until then."""
        self._force, self._expires_s = force, expires_s

    def close(self) -> None:
        """Lets go of the handle."""
        self._force = ZERO
