"""Checks the plausibility of a haptic device's readings."""

import itertools
import math

from robot_model.geometry import ZERO, Vector, angle_between, minus, norm, plus, scaled

from .device import HapticConfig, HapticReading, ReadingError

MAX_DISTANCE_RADII = 3.0
"""Largest distance of a reading from the middle of the workspace, in radii of the workspace."""
SLACK_M = 0.01
"""Tolerance of the distance between two readings, for noise and late readings [m]. Added to the largest motion."""
TURN_SLACK = 0.3
"""Tolerance of the angle between two orientations [rad]. Added to the largest rotation."""
MAX_TURN = 30.0
"""Largest rate at which a hand rotates a handle [rad/s]."""
MOVED_AFTER = 50
"""Number of consistent readings at another place after which this place is accepted and the handle engaged again."""
WINDOW_S = 0.1
"""Time span over which displacement and velocity are compared [s]."""
GAP_S = 0.01
"""Time between two readings above which the comparison of displacement and velocity restarts [s]."""
MIN_DISPLACEMENT_M = 0.005
"""Displacement within `WINDOW_S` below which displacement and velocity are not compared [m]."""


class ReadingCheck:
    """Refuses implausible readings, and reports the likely cause.

    If the device measures its velocity, the velocity is compared with the displacement. Differences reveal positions in
    millimetres, swapped axes and a stuck sensor.

    Args:
        config: Properties of the device.
    """

    def __init__(self, config: HapticConfig) -> None:
        self._config = config
        self._last: HapticReading | None = None
        self._last_s = 0.0
        self._elsewhere: list[HapticReading] = []
        self._window_s = 0.0
        self._moved = self._claimed = ZERO
        self._suspect: ReadingError | None = None
        self.has_moved = False
        """Whether the last reading was accepted although its position is not continuous with the previous reading."""

    def forget(self) -> None:
        """Drops the last reading, so that the next reading is accepted at any position."""
        self._last = None
        self._elsewhere.clear()

    def checked(self, reading: HapticReading, now_s: float) -> HapticReading:
        """Checks a reading, and returns the reading with a normalized quaternion.

        Raises:
            ReadingError: If the reading is implausible.
        """
        self.has_moved = False
        reading = self._possible(reading)
        last, dt_s = self._last, now_s - self._last_s
        if last is None:
            self.has_moved = True
            self._begin_window()
        else:
            self._check_step(last, reading, dt_s)
            self._compare(minus(reading.position, last.position), reading.velocity, dt_s)
        self._last, self._last_s = reading, now_s
        self._elsewhere.clear()
        if self._suspect is not None:
            raise self._suspect
        return reading

    def _possible(self, reading: HapticReading) -> HapticReading:
        """Makes the checks that need no earlier readings. Returns the reading with a normalized quaternion."""
        position, velocity, quat, _ = reading
        if not math.isfinite(sum(position) + sum(quat) + sum(velocity or ZERO)):
            raise ReadingError("not finite", f"position {position}, velocity {velocity}, quaternion {quat}")
        length = math.hypot(*quat)
        if not 0.9 < length < 1.1:
            raise ReadingError("quaternion", f"expected a quaternion of length 1, got {quat}")
        workspace_m = self._config.workspace_m
        far = norm(position)
        if far > MAX_DISTANCE_RADII * workspace_m:
            if far <= MAX_DISTANCE_RADII * workspace_m * 1000.0:
                where = f"{far:g} m from the middle of a workspace of {workspace_m:g} m: are these millimetres?"
                raise ReadingError("millimetres", where)
            raise ReadingError("far away", f"{far:g} m from the middle of a workspace of {workspace_m:g} m")
        x, y, z, w = quat
        return reading._replace(quat_xyzw=(x / length, y / length, z / length, w / length))

    def _check_step(self, last: HapticReading, reading: HapticReading, dt_s: float) -> None:
        step_m = norm(minus(reading.position, last.position))
        turn = angle_between(last.quat_xyzw, reading.quat_xyzw)
        if step_m > SLACK_M + self._config.max_speed * dt_s:
            error = ReadingError("jump", f"{step_m * 1e3:.0f} mm from the last one, {dt_s * 1e3:.0f} ms later")
        elif turn > TURN_SLACK + MAX_TURN * dt_s:
            x, y, z, w = reading.quat_xyzw
            swapped = min(angle_between(last.quat_xyzw, (w, x, y, z)), angle_between(last.quat_xyzw, (y, z, w, x)))
            if swapped < TURN_SLACK:
                error = ReadingError("wxyz", "quaternions x, y, z, w and w, x, y, z by turns")
            else:
                error = ReadingError("turn", f"{math.degrees(turn):.0f} deg from the last one")
        else:
            return
        # The device may really be there, for instance after it was homed
        near = self._elsewhere
        if near and norm(minus(reading.position, near[-1].position)) > SLACK_M + self._config.max_speed * dt_s:
            near.clear()
        if near and angle_between(near[-1].quat_xyzw, reading.quat_xyzw) > TURN_SLACK:
            near.clear()
        near.append(reading)
        if len(near) <= MOVED_AFTER:
            raise error
        self.has_moved = True
        self._begin_window()

    def _begin_window(self) -> None:
        self._window_s = 0.0
        self._moved = self._claimed = ZERO

    def _compare(self, displacement: Vector, velocity: Vector | None, dt_s: float) -> None:
        """Compares the displacement over a time window with the integral of the measured velocity.

        If they differ too much, stores the error that `checked` then raises.
        """
        if velocity is None or self.has_moved:
            return
        if dt_s > GAP_S:  # the velocity during the gap is unknown
            self._begin_window()
            return
        self._window_s += dt_s
        self._moved, self._claimed = plus(self._moved, displacement), plus(self._claimed, scaled(dt_s, velocity))
        if self._window_s < WINDOW_S:
            return
        moved, claimed = self._moved, self._claimed
        self._begin_window()
        moved_m, claimed_m = norm(moved), norm(claimed)
        if max(moved_m, claimed_m) < MIN_DISPLACEMENT_M:
            return  # too little to decide, so the last result still holds
        self._suspect = None
        if norm(minus(moved, claimed)) < 0.5 * max(moved_m, claimed_m):
            return
        text = f"moved {_in_mm(moved)}, but by its velocity {_in_mm(claimed)}"
        self._suspect = ReadingError(_likely_fault(moved, claimed), text)


def _likely_fault(moved: Vector, claimed: Vector) -> str:
    """Returns the fault that best explains why the displacement differs from the integrated velocity.

    Args:
        moved: Measured displacement [m].
        claimed: Integral of the measured velocity over the same time [m].
    """
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


def _in_mm(displacement: Vector) -> str:
    return "({:.0f}, {:.0f}, {:.0f}) mm".format(*scaled(1e3, displacement))
