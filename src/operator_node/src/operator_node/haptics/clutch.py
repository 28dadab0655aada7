"""From the handle to the tool: relative, so that nothing jumps when a person takes hold of it."""

from collections.abc import Sequence

from rpbi.geometry import Vector, minus, plus, scaled

from .vectors import ZERO, norm


class Clutch:
    """Couples way to way: whatever handle and tool stood at before, they go on together from there.

    Args:
        button: Number of the button that has to be held; None couples all the time.

    Attributes:
        engaged: Whether they are coupled.
        deviation: Way of the handle since they were [m].
    """

    def __init__(self, button: int | None = None) -> None:
        self._button = button
        self.engaged = False
        self._kept = self._reference = self.deviation = ZERO

    @property
    def way(self) -> Vector:
        """Way of the tool since the start, in metres of the handle."""
        return plus(self._kept, self.deviation)

    def update(self, position: Vector, buttons: Sequence[int]) -> bool:
        """Takes where the handle is [m]; returns whether it was engaged just now."""
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
        """Lets go: the tool stays where it is; with a button held it is engaged again at the next update."""
        self._kept, self.deviation, self.engaged = self.way, ZERO, False

    def set_way(self, way: Vector) -> None:
        """Has the tool be somewhere [m], and the handle go on from there."""
        self._kept, self.engaged, self.deviation = way, False, ZERO


class Target:
    """Where the tool is to go: it follows the handle no faster than a limit, and stays in a box.

    Args:
        scale: Way of the tool for each metre of the handle, by axis; 0 holds an axis.
        low: Least way from the start, by axis [m].
        high: Most [m].
        max_speed: [m/s].
    """

    def __init__(self, scale: Vector, low: Vector, high: Vector, max_speed: float) -> None:
        self._scale, self._low, self._high, self._max_speed = scale, low, high, max_speed
        self.way: Vector = ZERO

    def follow(self, way: Vector, dt_s: float) -> Vector:
        """Returns the tool's way from the start, in its own metres, some time after the last one."""
        wanted = self.limited((way[0] * self._scale[0], way[1] * self._scale[1], way[2] * self._scale[2]))
        left = minus(wanted, self.way)
        far, most = norm(left), self._max_speed * dt_s
        self.way = wanted if far <= most else plus(self.way, scaled(most / far, left))
        return self.way

    def limited(self, way: Vector) -> Vector:
        """Returns a way within the box."""
        (ax, ay, az), (bx, by, bz) = self._low, self._high
        return min(max(way[0], ax), bx), min(max(way[1], ay), by), min(max(way[2], az), bz)
