"""The last thing before the device: how large a force may be, and how fast it may grow."""

import math

from rpbi.geometry import Vector, dot, scaled

from .vectors import ZERO, norm


class ForceLimiter:
    """Shortens forces, so that none is larger than a limit and none grows faster than a slew limit.

    Directions are kept, so what brakes still brakes. A force may become smaller, or zero, at once: that never hurts.

    Args:
        max_force_n: The largest force [N].
        slew_n_per_s: How fast it may grow [N/s].

    Attributes:
        not_finite: How many forces were refused since a number was not finite.
    """

    def __init__(self, max_force_n: float, slew_n_per_s: float) -> None:
        self._max_force_n, self._slew = max_force_n, slew_n_per_s
        self._last = ZERO
        self.not_finite = 0

    def limited(self, force: Vector, dt_s: float) -> Vector:
        """Returns what is left of a force [N] some time after the last one."""
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
        """Takes what became of the force afterwards [N]; the next one grows from there."""
        self._last = force
