"""Emulates a robot's controller, which checks commands against limits and stops the robot at a violation."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

from .config import DriverJointLimits, FakeDriverConfig

RATE_WINDOW_S = 1.0
"""Time over which the rate of commands is measured [s]."""
REST_SHARE = 0.02
"""Velocity up to which a joint counts as at rest when commands end, as a fraction of the joint's velocity limit."""
EFFORT_SHARE = 0.999
"""Effort from which a motor counts as saturated, as a fraction of the motor's limit.

Less than 1 to tolerate rounding, since motors never exceed the limit itself.
"""
MAX_CYCLE_S = 0.05
"""Longest time by which one cycle advances a reflex stop [s]. On a slow machine, longer cycles count as this time."""
SPACING_GAIN = 0.05
"""Fraction of a command's lateness that is added to the time of the command's set point.

Lateness is measured from the nominal time, which is one cycle after the previous set point.
"""
MAX_GAP_S = 0.2
"""Lateness above which a command's arrival time becomes the time of the command's set point [s]."""
MIN_SPACING = 0.5
"""Shortest time between two set points, as a fraction of a cycle."""

Vector = tuple[float, ...]


class Mode(IntEnum):
    """State of the controller."""

    IDLE = 0
    MOVE = 1
    REFLEX = 2


class Reflex(NamedTuple):
    """Reason why the controller stopped the robot.

    Attributes:
        check: Name of the check that failed, such as `velocity`.
        joint: Name of the joint in the simulator; empty if the check does not concern a single joint.
        value: Value that failed the check; 0 if there is no finite value.
        limit: Limit that the value violates; 0 if the check has no numeric limit.
        what: Description of the violation in words.
    """

    check: str
    joint: str
    value: float
    limit: float
    what: str

    def __str__(self) -> str:
        joint = f"{self.joint}: " if self.joint else ""
        return f"{self.check}: {joint}{self.what}"


@dataclass
class Counters:
    """Counts of events since the controller started.

    `peaks` has the largest commanded velocity, acceleration and jerk since the last recovery, divided by their limits.
    """

    commands: int = 0
    ignored: int = 0
    reflexes: int = 0
    recoveries: int = 0
    peaks: dict[str, float] = field(default_factory=lambda: dict.fromkeys(("velocity", "acceleration", "jerk"), 0.0))


class _Motion(NamedTuple):
    """Commanded joint positions. Velocities and accelerations are finite differences of successive commands."""

    position: Vector
    velocity: Vector
    acceleration: Vector


class SetPoint(NamedTuple):
    """Target positions of the motors at one time.

    Attributes:
        time_s: Time on the same clock as the arrival times of commands [s]. Successive set points are about one cycle
            apart, even if commands arrive unevenly.
        position: Joint positions [rad or m].
    """

    time_s: float
    position: Vector


class RobotController:
    """Checks each command, forwards valid commands unchanged, and stops the robot at the first violation of a limit.

    Such a stop is called a reflex. Velocity, acceleration and jerk are finite differences of successive commands over
    one cycle of `1/command_hz`, even if commands arrive unevenly. The command rate and time-out are checked separately.

    Args:
        config: Configuration of the controller.
        limits: Joint limits, keyed by joint name. All vectors of joint values are in the order of these keys.
        position: Initial joint positions [rad or m].
    """

    def __init__(
        self, config: FakeDriverConfig, limits: Mapping[str, DriverJointLimits], position: Sequence[float]
    ) -> None:
        self._config, self._names, self._limits = config, tuple(limits), tuple(limits.values())
        self._cycle_s = 1.0 / config.command_hz
        self.mode = Mode.IDLE
        self.reflex: Reflex | None = None
        self.counters = Counters()
        self._motion = self._at_rest(position)
        self._sent = self._motion
        self._waiting: deque[tuple[float, float, _Motion]] = deque()
        self._planned_s = -math.inf
        self._arrivals_s: deque[float] = deque()
        self._last_cycle_s: float | None = None
        self._saturated_s: dict[str, float] = {}

    @property
    def is_braking(self) -> bool:
        """Whether the robot is still decelerating in a reflex stop."""
        return self.mode is Mode.REFLEX and any(self._sent.velocity)

    @property
    def set_point(self) -> Vector:
        """Joint positions that the motors currently hold or drive to [rad or m]."""
        return self._sent.position

    def command(self, now_s: float, position: Sequence[float]) -> None:
        """Checks a command and queues it for the motors. An invalid command triggers a reflex.

        During a reflex, commands are only counted.

        Args:
            now_s: Arrival time of the command, on the caller's clock [s].
            position: Commanded joint positions [rad or m].
        """
        if self.mode is Mode.REFLEX:
            self.counters.ignored += 1
            return
        wrong = self._invalid(position) or self._note_arrival(now_s)
        if wrong is None:
            asked = tuple(map(float, position))
            motion = self._at_rest(asked) if self.mode is Mode.IDLE else self._after(asked)
            wrong = self._refuse_start(motion) if self.mode is Mode.IDLE else self._refuse(motion)
        if wrong is not None:
            self._stop(wrong)
            return
        self.mode, self._motion = Mode.MOVE, motion
        self.counters.commands += 1
        self._planned_s = self._planned(now_s)
        delay_s = self._config.command_delay_s
        self._waiting.append((now_s + delay_s, self._planned_s + delay_s, motion))

    def refuse_command(self, what: str) -> None:
        """Triggers a reflex for a malformed command, for example one that lacks a joint. `what` describes the fault."""
        if self.mode is Mode.REFLEX:
            self.counters.ignored += 1
        else:
            self._stop(Reflex("command_invalid", "", 0.0, 0.0, what))

    def cycle(self, now_s: float, position: Sequence[float], effort: Sequence[float]) -> list[SetPoint]:
        """Checks the measured state, continues braking during a reflex, and returns the new set points.

        Args:
            now_s: Present time, on the same clock as the arrival times of commands [s].
            position: Measured joint positions [rad or m].
            effort: Measured efforts of the motors [N m or N].

        Returns:
            Set points that have become due since the last cycle, oldest first.
        """
        last_s, self._last_cycle_s = self._last_cycle_s, now_s
        if self.mode is not Mode.REFLEX:
            wrong = self._overloaded(now_s, effort) or self._left_behind(position) or self._silent(now_s)
            if wrong is not None:
                self._stop(wrong)
        if self.mode is Mode.REFLEX:
            return self._brake(now_s, min(now_s - (now_s if last_s is None else last_s), MAX_CYCLE_S))
        points = []
        while self._waiting and self._waiting[0][0] <= now_s:
            _, time_s, self._sent = self._waiting.popleft()
            points.append(SetPoint(time_s, self._sent.position))
        return points

    def recover(self, position: Sequence[float]) -> str | None:
        """Ends a reflex. Returns None on success, otherwise the reason for the refusal.

        Args:
            position: Measured joint positions [rad or m]. They become the set point.
        """
        if self.mode is not Mode.REFLEX:
            return "there is no reflex to recover from"
        if self.is_braking:
            return "the robot has not come to rest yet"
        self.mode = Mode.IDLE
        self.counters.recoveries += 1
        self.counters.peaks = Counters().peaks
        self._saturated_s.clear()
        self._motion = self._sent = self._at_rest(position)
        return None

    # Checks

    def _invalid(self, position: Sequence[float]) -> Reflex | None:
        if len(position) != len(self._names):
            what = f"expected {len(self._names)} positions, got {len(position)}"
            return Reflex("command_invalid", "", 0.0, 0.0, what)
        for name, value in zip(self._names, position):
            if not math.isfinite(value):
                return Reflex("command_invalid", name, 0.0, 0.0, f"expected a finite position, got {value:g}")
        return None

    def _note_arrival(self, now_s: float) -> Reflex | None:
        """Records the arrival of a command. Returns a reflex if the rate of commands is wrong, otherwise None."""
        config, arrivals_s = self._config, self._arrivals_s
        if self.mode is Mode.IDLE:
            arrivals_s.clear()
        arrivals_s.append(now_s)
        if now_s - arrivals_s[0] < RATE_WINDOW_S:
            return None
        rate = (len(arrivals_s) - 1) / (now_s - arrivals_s[0])
        arrivals_s.clear()
        arrivals_s.append(now_s)
        share = rate / config.command_hz - 1.0
        if abs(share) <= config.rate_tolerance:
            return None
        limit = config.command_hz * (1.0 + math.copysign(config.rate_tolerance, share))
        return Reflex("command_rate", "", rate, limit, f"{rate:.4g} Hz, expected {config.command_hz:g} Hz")

    def _refuse_start(self, motion: _Motion) -> Reflex | None:
        for name, held, value in zip(self._names, self._sent.position, motion.position):
            if abs(value - held) > self._config.start_tolerance:
                what = f"begins {value - held:.3g} from where the robot stands, at {held:.4g}"
                return Reflex("start_position", name, value - held, self._config.start_tolerance, what)
        return self._beyond_limits(motion.position, self._sent.position)

    def _refuse(self, motion: _Motion) -> Reflex | None:
        """Returns a reflex for the first limit that a new command violates; None if the command keeps all limits."""
        last = self._motion.position
        for name, limits, start, end in zip(self._names, self._limits, last, motion.position):
            step = 3.0 * limits.velocity * self._cycle_s if limits.step is None else limits.step
            if abs(end - start) > step:
                return Reflex(
                    "discontinuity", name, end - start, step, f"jumps by {end - start:.3g}, at most {step:.3g}"
                )
        wrong = self._beyond_limits(motion.position, last)
        if wrong is not None:
            return wrong
        jerks = tuple((a - b) / self._cycle_s for a, b in zip(motion.acceleration, self._motion.acceleration))
        for check, values in (("velocity", motion.velocity), ("acceleration", motion.acceleration), ("jerk", jerks)):
            allowed = tuple(getattr(limits, check) for limits in self._limits)
            shares = [abs(value) / limit for value, limit in zip(values, allowed)]
            self.counters.peaks[check] = max(self.counters.peaks[check], *shares)
            worst = max(range(len(shares)), key=shares.__getitem__)
            if shares[worst] > 1.0:
                value, limit = values[worst], allowed[worst]
                what = f"{check} {value:.4g}, at most {limit:g}"
                return Reflex(check, self._names[worst], value, limit, what)
        return None

    def _beyond_limits(self, position: Vector, last: Vector) -> Reflex | None:
        """Returns a reflex if a joint leaves its position limits. A joint already outside may not move further out."""
        for name, limits, value, before in zip(self._names, self._limits, position, last):
            if not min(limits.lower, before) <= value <= max(limits.upper, before):
                limit = limits.lower if value < limits.lower else limits.upper
                return Reflex("position", name, value, limit, f"position {value:.4g}, limit {limit:g}")
        return None

    def _overloaded(self, now_s: float, effort: Sequence[float]) -> Reflex | None:
        """Returns a reflex if a motor has been saturated for too long, otherwise None."""
        wrong = None
        for name, limits, torque in zip(self._names, self._limits, effort):
            if abs(torque) < EFFORT_SHARE * limits.torque:
                self._saturated_s.pop(name, None)
                continue
            if now_s - self._saturated_s.setdefault(name, now_s) >= self._config.torque_time_s:
                what = f"torque {torque:.4g}, limit {limits.torque:g}"
                wrong = wrong or Reflex("torque", name, torque, limits.torque, what)
        return wrong

    def _left_behind(self, position: Sequence[float]) -> Reflex | None:
        for name, limits, wanted, is_at in zip(self._names, self._limits, self._sent.position, position):
            if abs(wanted - is_at) > limits.following_error:
                what = f"is {wanted - is_at:.3g} behind, at most {limits.following_error:g}"
                return Reflex("following_error", name, wanted - is_at, limits.following_error, what)
        return None

    def _silent(self, now_s: float) -> Reflex | None:
        """Returns a reflex if commands have stopped while the robot moves, otherwise None.

        If commands have stopped while the robot is at rest, sets the mode to IDLE.
        """
        if self.mode is not Mode.MOVE or now_s - self._arrivals_s[-1] <= self._config.timeout_s or self._waiting:
            return None
        shares = [abs(v) / limits.velocity for v, limits in zip(self._motion.velocity, self._limits)]
        if max(shares) <= REST_SHARE:
            self.mode = Mode.IDLE
            return None
        age_s, limit_s = now_s - self._arrivals_s[-1], self._config.timeout_s
        return Reflex("command_timeout", "", age_s, limit_s, f"no command for {age_s:.3g} s, while it moves")

    # Motion

    def _after(self, position: Vector) -> _Motion:
        last = self._motion
        velocity = tuple((q - q0) / self._cycle_s for q, q0 in zip(position, last.position))
        return _Motion(position, velocity, tuple((v - v0) / self._cycle_s for v, v0 in zip(velocity, last.velocity)))

    def _at_rest(self, position: Sequence[float]) -> _Motion:
        still = (0.0,) * len(self._names)
        return _Motion(tuple(map(float, position)), still, still)

    def _stop(self, reflex: Reflex) -> None:
        self.mode, self.reflex = Mode.REFLEX, reflex
        self.counters.reflexes += 1
        self._waiting.clear()

    def _planned(self, now_s: float) -> float:
        """Returns the set-point time [s] of a command that arrives now: about a cycle after the previous set point."""
        planned_s = self._planned_s + self._cycle_s
        if now_s - planned_s > MAX_GAP_S:
            return now_s
        return max(planned_s + SPACING_GAIN * (now_s - planned_s), self._planned_s + MIN_SPACING * self._cycle_s)

    def _brake(self, now_s: float, cycle_s: float) -> list[SetPoint]:
        """Decelerates every joint at its acceleration limit. Returns the new set point, or an empty list at rest."""
        if not self.is_braking:
            return []
        position, velocity = [], []
        for q, v, limits in zip(self._sent.position, self._sent.velocity, self._limits):
            slower = math.copysign(max(abs(v) - limits.acceleration * cycle_s, 0.0), v) if v else 0.0
            time_s = (abs(v) - abs(slower)) / limits.acceleration
            position.append(q + 0.5 * (v + slower) * time_s + slower * (cycle_s - time_s))
            velocity.append(slower or 0.0)
        self._sent = _Motion(tuple(position), tuple(velocity), (0.0,) * len(position))
        return [SetPoint(now_s, self._sent.position)]
