"""Relative mapping from handle to tool, so that nothing jumps when a user engages."""

from collections.abc import Sequence

from robot_model.geometry import ZERO, Vector, minus, norm, plus, scaled


class Clutch:
    """Couples displacements: after engaging, the tool moves with the handle, from wherever both were.

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
    def way(self) -> Vector:
        """Displacement of the tool since the start, in metres of the handle."""
        return plus(self._kept, self.deviation)

    def update(self, position: Vector, buttons: Sequence[int]) -> bool:
        """Updates the position of the handle [m]; returns whether it was engaged just now."""
        wanted = self._button is None or (self._button < len(buttons) and bool(buttons[self._button]))
        if wanted and not self.engaged:
            self.engaged, self._reference, self.deviation = True, position, ZERO
            return True
        if not wanted:
            self.release()
        elif self.engaged:
            self.deviation = minus(position, self._reference)
        return False

    def release(self) -> None:
        """Disengages: the tool stays where it is. While the button is held, the next update engages again."""
        self._kept, self.deviation, self.engaged = self.way, ZERO, False

    def set_way(self, way: Vector) -> None:
        """Sets the displacement of the tool [m] and disengages; the next motion of the handle continues from it."""
        self._kept, self.engaged, self.deviation = way, False, ZERO


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
        self.way: Vector = ZERO

    def follow(self, way: Vector, dt_s: float) -> Vector:
        """Returns the displacement of the tool from the start [m], `dt_s` after the last call."""
        wanted = self.limited((way[0] * self._scale[0], way[1] * self._scale[1], way[2] * self._scale[2]))
        left = minus(wanted, self.way)
        far, most = norm(left), self._max_speed * dt_s
        self.way = wanted if far <= most else plus(self.way, scaled(most / far, left))
        return self.way

    def limited(self, way: Vector) -> Vector:
        """Returns a displacement clipped to the box."""
        (ax, ay, az), (bx, by, bz) = self._low, self._high
        return min(max(way[0], ax), bx), min(max(way[1], ay), by), min(max(way[2], az), bz)
