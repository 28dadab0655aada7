"""Limits of force and of its growth; the last stage before the device."""

import math

from robot_model.geometry import ZERO, Vector, dot, norm, scaled


class ForceLimiter:
    """Shortens forces to a largest force and a largest slew rate.

    Directions are kept, so that a braking force still brakes. A force may become smaller, or zero, at once.

    Args:
        max_force_n: Largest force [N].
        slew_n_per_s: Largest rate at which a force may grow [N/s].

    Attributes:
        not_finite: Number of forces refused because a component was not finite.
    """

    def __init__(self, max_force_n: float, slew_n_per_s: float) -> None:
        self._max_force_n, self._slew = max_force_n, slew_n_per_s
        self._last = ZERO
        self.not_finite = 0

    def limited(self, force: Vector, dt_s: float) -> Vector:
        """Returns the limited force [N], `dt_s` after the last one."""
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
        """Sets the force that was finally sent [N]; the next one grows from it."""
        self._last = force
