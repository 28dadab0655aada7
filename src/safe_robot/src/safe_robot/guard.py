"""The guard, which decides for each target which command the robot receives."""

import logging
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from custom_ros_tools.errors import ConfigError, Problem
from robot_model.model import RobotModel
from safe_robot.commands.safe_search import can_keep_bounds

from .braking import Brake, Braking, BrakingCommands
from .check import Check, CheckContext, MarginViolation, Violation
from .checks import make_checks
from .checks.staleness import Staleness
from .commands.escape import EscapeDirection, find_escape
from .commands.pursuit import ROUNDING
from .commands.safe_search import SafeCommandSearch
from .commands.shaping import Shaper
from .config import GuardConfig
from .first_target import FirstTarget
from .limits import MotionLimits
from .motion import CommandedMotion, State

log = logging.getLogger(__name__)

MENDED_BY_BRAKING = ("joint_velocity", "joint_acceleration", "joint_jerk", "joint_position", "braking")
"""If a smoothed command fails one of these checks, the next braking command is tried instead."""


class Decision(NamedTuple):
    """A guard's decision about a target.

    Attributes:
        command: The n positions to command [rad or m]. A safe target that is not smoothed is commanded unchanged. None:
            nothing is sent, for example because the stamp is repeated.
        violation: Reason why the target is not safe; None if the target is safe, or was not checked.
        is_halted: Whether targets are refused until `Guard.start` is called.
        is_shaped: Whether the target was smoothed.
    """

    command: tuple[float, ...] | None
    violation: Violation | None = None
    is_halted: bool = False
    is_shaped: bool = False


class _Safe(NamedTuple):
    """A safe command, and the braking after it."""

    command: tuple[float, ...]
    state: State
    stop: BrakingCommands


class Guard:
    """Passes on safe targets, and replaces or refuses unsafe targets.

    A target is safe if the target and the braking that would follow both pass every check. After every command, a known
    braking can therefore bring the robot to rest within all limits.

    Except at a start, motions are computed from the previous command, not from a measurement. Each command is assumed
    to last one period, independently of stamps, so that stamps cannot make the robot faster. The caller ensures that
    commands are at least a period apart.

    If several targets have the same stamp, only the first causes a command. The check `staleness` ignores the others,
    as if they had not arrived.

    With the option `shape`, a target that the joints cannot follow is smoothed, and the smoothed command is checked.

    Args:
        config: Configuration of the guard.
        robot: The guarded robot.
        file: Source of the configuration, for messages.

    Attributes:
        config: Configuration of the guard.
        robot: The guarded robot.
        joint_names: Names of the n guarded joints.
        limits: Limits of the n joints.
        checks: The checks in use.
        is_halted: Whether targets are refused until `start` is called; True at first.

    Raises:
        ConfigError: If the configuration does not fit the robot.
    """

    def __init__(self, config: GuardConfig, robot: RobotModel, file: str = "~") -> None:
        self.config, self.robot = config, robot
        self.joint_names = robot.joint_names
        self.limits = MotionLimits.of(robot, config.limits, file)
        self.checks = make_checks(config.checks, robot, self.limits, file)
        try:
            self._braking = Braking(self.limits.velocity, self.limits.acceleration, self.limits.jerk, config.period_s)
        except ValueError as error:
            raise ConfigError([Problem(file, "limits", str(error))]) from None
        shape = (self.limits, self._braking, config.period_s)
        self._shaper = None if config.shape is None else Shaper(config.shape, *shape)
        self._first_target = FirstTarget(config, robot, self.checks, file)
        self._watches = {check.name for check in self.checks if check.watches}
        self._nearest = SafeCommandSearch(self.limits, self._braking, self.checks, config.period_s)
        if config.policy == "limit" and not can_keep_bounds():
            log.warning("%s: policy limit tracks targets less closely without DAQP: run `./rpbi setup ik`", file)
        self.is_halted = True
        self._is_late = False
        self._state: State | None = None
        self._is_first = True
        self._target: tuple[float, ...] | None = None
        self._stop = BrakingCommands.none(len(self.joint_names))

    @property
    def is_moving(self) -> bool:
        """Whether the robot still moves, according to the last commands."""
        return self._state is not None and not self._state.is_at_rest

    @property
    def is_braking(self) -> bool:
        """True if `next_braking` has commands: the robot still moves, and the guard is halted or targets are late."""
        return (self.is_halted or self._is_late) and self.is_moving

    @property
    def last_command(self) -> tuple[float, ...] | None:
        """The n positions that were commanded last [rad or m]; None before the first command after `start`."""
        return None if self._state is None or self._is_first else tuple(self._state.position.tolist())

    @property
    def stop_commands(self) -> np.ndarray:
        """Commands that bring the robot to rest after the last command, shape (k, n) [rad or m].

        These commands have passed the checks.
        """
        return self._stop.position.copy()

    def way_out(self) -> EscapeDirection | None:
        """Returns the margins that the last command violates, and a joint motion that reduces all violations.

        Returns None if no margin is violated, or before the first command.
        """
        if self._state is None or self._is_first:
            return None
        return find_escape(self._state.position, self.limits, self._inside)

    def start(self) -> None:
        """Accepts targets again; the first target has to be near the robot.

        Raises:
            RuntimeError: If the robot still brakes.
        """
        if self.is_braking:
            raise RuntimeError("the robot still brakes: start when next_braking() returns None")
        self.is_halted, self._is_late, self._is_first = False, False, True

    def halt(self) -> None:
        """Refuses further targets.

        With the option `on_halt: brake`, `next_braking` then returns the commands that stop the robot.
        """
        self.is_halted = True
        if self.config.on_halt == "nothing":
            self._assume_rest()

    def wait_for_target(self) -> None:
        """Ends the motion because no recent target has arrived.

        With the policy `reject`, the guard halts. With `limit`, the robot stops as after a halt, but follows the next
        target.
        """
        if self.config.policy == "reject":
            self.halt()
            return
        self._is_late = True
        if self.config.on_halt == "nothing":
            self._assume_rest()

    def rest(self) -> None:
        """Halts without braking: the robot is assumed to rest at the last command."""
        self.is_halted = True
        self._assume_rest()

    def _assume_rest(self) -> None:
        if self._state is not None:
            self._state = State.at_rest(self._state.position)
        self._stop = BrakingCommands.none(len(self.joint_names))

    def next_braking(self) -> tuple[float, ...] | None:
        """Advances the braking by one command, and returns the n positions of that command [rad or m].

        The command has to be sent one period after the previous command. Returns None if the robot does not brake.
        """
        return self._continue_braking() if self.is_braking else None

    def decide(self, target: Sequence[float], context: CheckContext) -> Decision:
        """Decides on the command for a target, and updates the state of the guard.

        Args:
            target: n positions [rad or m].
            context: Context of the checks, such as times, measurements and obstacles.
        """
        if self.is_halted:
            return Decision(None, None, True)
        self._is_late = False
        try:
            decision = self._decision_for(tuple(target), context)
        except BaseException:
            self.halt()  # fails closed: without a verdict, the target is refused
            raise
        if decision.is_halted:
            self.halt()
        return decision

    def refuse(self, reason: str) -> Decision:
        """Refuses a target that cannot be checked; `reason` becomes the violation.

        The guard halts with the policy `reject`, or before the first command. Otherwise, the decision contains the next
        command of the braking.
        """
        if self.is_halted:
            return Decision(None, None, True)
        decision = self._brake_or_halt(Violation("input", reason, math.nan, math.nan, ""))
        if decision.is_halted:
            self.halt()
        return decision

    def check_watchdogs(self, context: CheckContext) -> Violation | None:
        """Runs the checks that do not need a target, and returns the first violation; None if there is none.

        After a violation, the guard halts. If targets are late, the guard calls `wait_for_target` instead.
        """
        if self.is_halted or self._is_first or self._state is None:
            return None
        try:
            violation = self._watchdog_violation(context)
        except BaseException:
            self.halt()
            raise
        if violation is not None:
            self.wait_for_target() if violation.check == Staleness.name else self.halt()
        return violation

    def _watchdog_violation(self, context: CheckContext) -> Violation | None:
        assert self._state is not None
        motion = CommandedMotion(self.robot, self._state, self._state.position, self.config.period_s)
        watches = [each for each in self.checks if each.watches and not (self._is_late and each.name == Staleness.name)]
        found = (each.check(motion, context) for each in watches)
        return next(filter(None, found), None)

    def _decision_for(self, target: tuple[float, ...], context: CheckContext) -> Decision:
        if violation := self._input_problem(target):
            return self._brake_or_halt(violation)
        is_first = self._is_first
        if is_first and (violation := self._start_at(target, context)):
            return Decision(None, violation, math.isfinite(violation.value))  # positions unknown: wait, do not halt
        assert self._state is not None
        if context.stamp_step_s == 0.0 and not is_first:
            repeated = self._watchdog_violation(context)
            return Decision(None) if repeated is None else self._brake_or_halt(repeated)
        wanted = target
        if self._shaper is not None:  # controllers assume rest at the first command: command the present position
            wanted = (
                tuple(self._state.position.tolist())
                if is_first
                else self._shaper.shaped(target, self._state, self._braking_commands)
            )
        found = self._evaluate(wanted, context, self.checks)
        if isinstance(found, Violation) and wanted != target and found.check in MENDED_BY_BRAKING:
            wanted = tuple(self._braking_commands[0].tolist())
            found = self._evaluate(wanted, context, self.checks)
        before, self._target = self._target, target
        if isinstance(found, Violation):
            return self._substitute(target, found, context)
        if violation := self._overshoot(target, before, found):
            return self._substitute(target, violation, context)
        return Decision(self._commit(found), is_shaped=wanted != target)

    def _overshoot(self, target: tuple[float, ...], before: tuple[float, ...] | None, safe: _Safe) -> Violation | None:
        """Returns a violation if braking after a safe command would move a joint past the joint's target.

        Ignores joints whose target has changed. Returns None if no joint would pass its target, or with the policy
        `reject`.

        Args:
            target: The present target, n positions [rad or m].
            before: The previous target, n positions [rad or m].
            safe: The safe command.
        """
        if self.config.policy == "reject" or before is None or not len(safe.stop.position):
            return None
        assert self._state is not None
        asked, end = np.array(target), safe.stop.position[-1]
        past = np.sign(asked - self._state.position) * (end - asked) * (asked == before)
        i = int(np.argmax(past))
        if past[i] <= ROUNDING:
            return None
        unit = "rad" if self.robot.joints[i].is_revolute else "m"
        return Violation("braking", f"joint '{self.joint_names[i]}'", float(end[i]), target[i], unit, True, "position")

    @property
    def _braking_commands(self) -> np.ndarray:
        """Commands that bring the robot to rest, shape (k, n), k >= 1. If the robot rests: its position, as one row."""
        assert self._state is not None
        return self._stop.position if len(self._stop.position) else self._state.position[None]

    def _brake_or_halt(self, violation: Violation) -> Decision:
        if self.config.policy == "reject" or self._is_first:
            return Decision(None, violation, True)
        return Decision(self._continue_braking(), violation)

    def _input_problem(self, target: tuple[float, ...]) -> Violation | None:
        n = len(self.joint_names)
        if len(target) != n:
            return Violation(
                "input",
                "the number of joints",
                len(target),
                n,
                "joints",
                words=f"expected {n} positions, got {len(target)}",
            )
        for name, position in zip(self.joint_names, target):
            if not math.isfinite(position):
                return Violation("input", f"joint '{name}'", position, math.inf, "rad or m", quantity="position")
        return None

    def _start_at(self, target: tuple[float, ...], context: CheckContext) -> Violation | None:
        """Checks the first target: sets the guard's initial state if the target is safe, or returns the violation."""
        last = None if self._state is None else self._state.position
        found = self._first_target.judged(np.array(target), last, context)
        if isinstance(found, Violation):
            return found
        self._state, self._stop, self._is_first = found, BrakingCommands.none(len(target)), False
        return None

    def _evaluate(
        self, command: Sequence[float], context: CheckContext, checks: Sequence[Check], is_trial: bool = False
    ) -> _Safe | Violation:
        """Runs checks on a command. Returns the command and the braking after the command, or the first violation."""
        assert self._state is not None
        period_s = self.config.period_s
        position = np.array(command)
        state = self._state.then(position, period_s)
        brake = self._brake(state)
        motion = CommandedMotion(self.robot, self._state, position, period_s, brake, is_trial)
        for check in checks:
            if violation := check.check(motion, context):
                return violation
        if brake is None:
            return self._cannot_brake(state)
        return _Safe(tuple(command), state, motion.braking_commands)

    def _brake(self, state: State) -> Brake | None:
        """Returns a braking from the state after a command; None if no braking keeps the limits.

        Joints whose command belongs to the present braking continue this braking.
        """
        keeps_braking = np.zeros(len(state.position), dtype=bool)
        if len(self._stop.position):
            keeps_braking = (state.position == self._stop.position[0]) & (state.velocity != 0.0)
        if not keeps_braking.any():
            return self._braking.plan(state.velocity, state.acceleration)
        brake = self._braking.plan(
            np.where(keeps_braking, 0.0, state.velocity), np.where(keeps_braking, 0.0, state.acceleration)
        )
        if brake is None:
            return None
        return brake.with_joints_of(self._stop.after_first().brake_from(state.position), keeps_braking)

    def _cannot_brake(self, state: State) -> Violation:
        share = np.abs(state.acceleration) / self.limits.acceleration
        i = int(np.argmax(share))
        subject, limit = f"joint '{self.joint_names[i]}'", float(self.limits.acceleration[i])
        unit = "rad/s^2" if self.robot.joints[i].is_revolute else "m/s^2"
        return Violation("braking", subject, float(abs(state.acceleration[i])), limit, unit, True, "acceleration")

    def _commit(self, safe: _Safe) -> tuple[float, ...]:
        self._state, self._stop = safe.state, safe.stop
        return safe.command

    def _substitute(self, target: tuple[float, ...], violation: Violation, context: CheckContext) -> Decision:
        """Replaces an unsafe target by a safe command near the target, or by the next braking command if none is found.

        With the policy `reject`, the guard halts instead. With another policy, the robot brakes at once if the failed
        check examines only the context, since no command could satisfy this check.
        """
        assert self._state is not None
        if self.config.policy == "reject" or violation.check in self._watches:  # no other command can satisfy these
            return self._brake_or_halt(violation)
        safe = self._nearest.find(
            np.array(target),
            self._state,
            self._braking_commands,
            lambda wanted, checks: self._evaluate(tuple(wanted.tolist()), context, checks, is_trial=True),
        )
        return Decision(self._continue_braking() if safe is None else self._commit(safe), violation)

    def _inside(self, q: np.ndarray) -> list[MarginViolation]:
        return [each for check in self.checks for each in check.inside(q)]

    def _continue_braking(self) -> tuple[float, ...]:
        assert self._state is not None
        if len(self._stop.position):
            self._state = self._state.then(self._stop.position[0], self.config.period_s)
            self._stop = self._stop.after_first()
        if not len(self._stop.position):
            self._state = State.at_rest(self._state.position)
        return tuple(self._state.position.tolist())
