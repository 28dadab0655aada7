"""Which readings of a haptic device are believed."""

import itertools
import math

from rpbi.geometry import Quaternion, Vector, minus, plus, scaled

from .device import HapticConfig, HapticReading, ReadingError
from .vectors import ZERO, norm

FARTHEST = 3.0
"""Readings beyond this many times the workspace are refused."""
SLACK_M = 0.01
"""So far a reading may be from the last one at any speed [m]: noise, and readings that came late."""
TURN_SLACK = 0.3
"""The same of its orientation [rad]..."""
MAX_TURN = 30.0
"""... and how fast no hand turns a handle [rad/s]."""
MOVED_AFTER = 50
"""After so many readings that lie together elsewhere, the device is there; it is engaged anew then."""
WINDOW_S = 0.1
"""How long way and velocity are compared [s]."""
GAP_S = 0.01
"""Longer without a reading, they are not [s]."""
LEAST_M = 0.005
"""Below this way in that time they are not [m]."""


class ReadingCheck:
    """Refuses readings that cannot be, and says what is probably the matter.

    A velocity that the device measures itself is compared with its way: what is in millimetres, has its axes swapped or
    is stuck shows that way.

    Args:
        config: What is known of the device.
    """

    def __init__(self, config: HapticConfig) -> None:
        self._config = config
        self._last: HapticReading | None = None
        self._last_s = 0.0
        self._elsewhere: list[HapticReading] = []
        self._window_s = self._way_m = 0.0
        self._moved = self._claimed = ZERO
        self._suspect: ReadingError | None = None
        self.has_moved = False
        """Whether the reading checked last is that of another place than the one before."""

    def forget(self) -> None:
        """Lets the next reading be anywhere."""
        self._last = None
        self._elsewhere.clear()

    def checked(self, reading: HapticReading, now_s: float) -> HapticReading:
        """Returns a reading with a unit quaternion.

        Raises:
            ReadingError: If it is not to be believed.
        """
        self.has_moved = False
        reading = self._possible(reading)
        last, dt_s = self._last, now_s - self._last_s
        if last is None:
            self.has_moved = True
            self._begin_window()
        else:
            self._check_way(last, reading, dt_s)
            self._compare(minus(reading.position, last.position), reading.velocity, dt_s)
        self._last, self._last_s = reading, now_s
        self._elsewhere.clear()
        if self._suspect is not None:
            raise self._suspect
        return reading

    def _possible(self, reading: HapticReading) -> HapticReading:
        """Returns a reading with a unit quaternion; looks at it alone."""
        position, velocity, quat, _ = reading
        if not math.isfinite(sum(position) + sum(quat) + sum(velocity or ZERO)):
            raise ReadingError("not finite", f"position {position}, velocity {velocity}, quaternion {quat}")
        length = math.hypot(*quat)
        if not 0.9 < length < 1.1:
            raise ReadingError("quaternion", f"expected a quaternion of length 1, got {quat}")
        workspace_m = self._config.workspace_m
        far = norm(position)
        if far > FARTHEST * workspace_m:
            if far <= FARTHEST * workspace_m * 1000.0:
                where = f"{far:g} m from the middle of a workspace of {workspace_m:g} m: are these millimetres?"
                raise ReadingError("millimetres", where)
            raise ReadingError("far away", f"{far:g} m from the middle of a workspace of {workspace_m:g} m")
        x, y, z, w = quat
        return reading._replace(quat_xyzw=(x / length, y / length, z / length, w / length))

    def _check_way(self, last: HapticReading, reading: HapticReading, dt_s: float) -> None:
        way_m = norm(minus(reading.position, last.position))
        turn = _angle(last.quat_xyzw, reading.quat_xyzw)
        if way_m > SLACK_M + self._config.max_speed * dt_s:
            error = ReadingError("jump", f"{way_m * 1e3:.0f} mm from the last one, {dt_s * 1e3:.0f} ms later")
        elif turn > TURN_SLACK + MAX_TURN * dt_s:
            x, y, z, w = reading.quat_xyzw
            swapped = min(_angle(last.quat_xyzw, (w, x, y, z)), _angle(last.quat_xyzw, (y, z, w, x)))
            if swapped < TURN_SLACK:
                error = ReadingError("wxyz", "quaternions x, y, z, w and w, x, y, z by turns")
            else:
                error = ReadingError("turn", f"{math.degrees(turn):.0f} deg from the last one")
        else:
            return
        # The device may be there indeed, for instance after it was homed
        near = self._elsewhere
        if near and norm(minus(reading.position, near[-1].position)) > SLACK_M + self._config.max_speed * dt_s:
            near.clear()
        if near and _angle(near[-1].quat_xyzw, reading.quat_xyzw) > TURN_SLACK:
            near.clear()
        near.append(reading)
        if len(near) <= MOVED_AFTER:
            raise error
        self.has_moved = True
        self._begin_window()

    def _begin_window(self) -> None:
        self._window_s = 0.0
        self._moved = self._claimed = ZERO

    def _compare(self, way: Vector, velocity: Vector | None, dt_s: float) -> None:
        """Compares the way of a window with the velocity that the device measured."""
        if velocity is None or self.has_moved:
            return
        if dt_s > GAP_S:  # what it had in between is not known
            self._begin_window()
            return
        self._window_s += dt_s
        self._moved, self._claimed = plus(self._moved, way), plus(self._claimed, scaled(dt_s, velocity))
        if self._window_s < WINDOW_S:
            return
        moved, claimed = self._moved, self._claimed
        self._begin_window()
        moved_m, claimed_m = norm(moved), norm(claimed)
        if max(moved_m, claimed_m) < LEAST_M:
            return  # too little to tell, so what was found before still holds
        self._suspect = None
        if norm(minus(moved, claimed)) < 0.5 * max(moved_m, claimed_m):
            return
        text = f"moved {_in_mm(moved)}, but by its velocity {_in_mm(claimed)}"
        self._suspect = ReadingError(_likely(moved, claimed), text)


def _likely(moved: Vector, claimed: Vector) -> str:
    """Returns the fault that explains best why way and velocity differ."""
    moved_m, claimed_m = norm(moved), norm(claimed)
    if moved_m < 1e-9:
        return "stuck"
    if claimed_m > 100.0 * moved_m or moved_m > 100.0 * claimed_m:
        return "millimetres"
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            other = tuple(sign * claimed[axis] for axis, sign in zip(order, signs))
            if norm(minus(moved, (other[0], other[1], other[2]))) < 0.2 * moved_m:
                return "axes swapped"
    return "velocity"


def _in_mm(way: Vector) -> str:
    return "({:.0f}, {:.0f}, {:.0f}) mm".format(*scaled(1e3, way))


def _angle(a: Quaternion, b: Quaternion) -> float:
    """Returns the angle between two orientations [rad]; q and -q are the same one."""
    return 2.0 * math.acos(min(abs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]), 1.0))
