"""The motors of a robot: control modes, set points, and the expiry of velocity and effort targets."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import pybullet

from rpbi.config.pybullet_args import CONTROL_MODES, IMPEDANCE_CONTROL
from rpbi.engine.client import Client
from rpbi.urdf.joints import Joint, JointModel

from .joint_command import JointCommand

log = logging.getLogger(__name__)

PERIOD_S = 5.0
"""Shortest interval [s], in wall time, between two warnings about the same joint."""


class LimitReports:
    """Logs a warning if a joint leaves its position limits, at most one warning per joint within `PERIOD_S`.

    The next warning about a joint requires that the joint has been within its limits again.
    """

    not_in_keyframes = ("_beyond", "_reported_s")

    def __init__(self, robot_name: str) -> None:
        self._robot_name = robot_name
        self._beyond: set[int] = set()
        self._reported_s: dict[int, float] = {}

    def observe(self, joint: Joint, position: float, what: str) -> None:
        """Logs a warning if a position is outside the joint's limits.

        There is no warning if the last observed position was outside, too, or if the last warning about the joint is
        not older than `PERIOD_S`.

        Args:
            joint: The joint.
            position: Measured or desired position of the joint [rad or m].
            what: Last words of the warning, about the consequence, such as `it goes to the limit`.
        """
        if joint.allows(position):
            self._beyond.discard(joint.index)
            return
        now_s = time.monotonic()
        last_s = self._reported_s.get(joint.index, -PERIOD_S)
        if joint.index not in self._beyond and now_s - last_s >= PERIOD_S:
            log.warning("%s: %s; %s", self._robot_name, joint.limit_violation(position), what)
            self._reported_s[joint.index] = now_s
        self._beyond.add(joint.index)


QUANTITIES = {
    pybullet.POSITION_CONTROL: "position",
    pybullet.VELOCITY_CONTROL: "velocity",
    pybullet.TORQUE_CONTROL: "effort",
    IMPEDANCE_CONTROL: "position",
}
"""Quantity that targets must contain, keyed by control mode."""
MAX_WAITING_TARGETS = 100
"""Largest number of targets that are queued for one tick; further targets are merged into the last one."""
MODE_NAMES = {CONTROL_MODES.parse(name): name for name in CONTROL_MODES.names}
POSITION_MODES = (pybullet.POSITION_CONTROL, IMPEDANCE_CONTROL)
"""Control modes with position targets, which never expire."""


class ResolvedCommand(NamedTuple):
    """A target that was checked for one control mode.

    Attributes:
        mode: The control mode.
        values: Positions, velocities or efforts, keyed by joint index.
        velocities: For position targets: velocities at the target positions, keyed by joint index; may be empty.
        stamp_ns: Time [ns] of sending by the sender's clock; 0 if unknown.
    """

    mode: int
    values: dict[int, float]
    velocities: Mapping[int, float] = {}
    stamp_ns: int = 0

    def merged(self, newer: ResolvedCommand) -> ResolvedCommand:
        """Returns a newer target, extended by this target's values for joints that the newer target lacks.

        The result has no velocities. If the control modes differ, returns the newer target unchanged.
        """
        return newer._replace(values=self.values | newer.values, velocities={}) if self.mode == newer.mode else newer


def coalesce(older: tuple[ResolvedCommand, ...], newer: tuple[ResolvedCommand, ...]) -> tuple[ResolvedCommand, ...]:
    """Joins two sequences of targets.

    If `older` is full (`MAX_WAITING_TARGETS` targets), `newer` must hold one target, which is merged into the last
    target of `older`.
    """
    if len(older) < MAX_WAITING_TARGETS:
        return older + newer
    return (*older[:-1], older[-1].merged(*newer))


class MotorGains(NamedTuple):
    """New motor gains of n joints.

    Attributes:
        names: n joint names.
        position: n gains for PyBullet's `positionGain`; empty to keep the present gains.
        velocity: n gains for PyBullet's `velocityGain`; empty to keep the present gains.
    """

    names: Sequence[str]
    position: Sequence[float] = ()
    velocity: Sequence[float] = ()


class Motors:
    """Commands the motors of one robot, within the limits of its URDF.

    A position target holds until the next target. Velocity and effort targets that are not renewed return to 0 after
    `timeout_s`, so that the robot stops when its sender stops. See `limited` for how targets are clipped.

    Args:
        mode: Initial control mode.
        gains: PyBullet's `positionGain` and `velocityGain`, keyed by joint index. Defaults are PyBullet's.
        limit_reports: Logs position targets beyond the joints' limits.
        enforce_effort_limits: Whether efforts are clipped to the URDF's effort limits.
        timeout_s: Age [s] at which velocity and effort targets expire, in the world's time.

    Attributes:
        targets: Set points of the motors, keyed by joint index. The control mode decides whether these are positions,
            velocities or efforts.
        impedance_setpoints: Positions [rad or m] and velocities [rad/s or m/s] that `track` set for the springs of
            `IMPEDANCE_CONTROL`, keyed by joint index. They override `targets`.
        applied_efforts: Efforts [N m or N] of torque targets, springs or a controller in the last tick, keyed by joint
            index. PyBullet does not report these efforts.
    """

    def __init__(
        self,
        pb: Client,
        body_id: int,
        model: JointModel,
        mode: int,
        gains: Mapping[int, Mapping[str, float]],
        limit_reports: LimitReports,
        enforce_effort_limits: bool,
        timeout_s: float,
    ) -> None:
        self._pb, self._body_id, self._model = pb, body_id, model
        self._limit_reports = limit_reports
        self._enforce_effort_limits = enforce_effort_limits
        self._effort_limits = {
            joint.index: model.effort_limit(joint) if enforce_effort_limits else math.inf for joint in model.driven
        }
        self._position_arguments = {joint.index: self._arguments(joint, gains) for joint in model.driven}
        self._velocity_arguments = {
            index: {key: value for key, value in arguments.items() if key in ("velocityGain", "force")}
            for index, arguments in self._position_arguments.items()
        }
        self._dt_s: float = pb.getPhysicsEngineParameters()["fixedTimeStep"]
        self._timeout_ticks = max(1, round(timeout_s / self._dt_s))
        self._indices = [joint.index for joint in model.driven]
        self._expiry: dict[int, int] = {}
        """Tick at which a joint's target expires, keyed by joint index."""
        self._renewed: set[int] = set()
        self._told: dict[int, tuple[int, dict[str, Any]]] = {}
        """Control mode and arguments last sent to PyBullet's motor of each joint, keyed by joint index."""
        self.switch(mode)

    def resume(self) -> None:
        """Sends the last commands of all motors again, for a new PyBullet client with the same robot."""
        for index, (mode, arguments) in self._told.items():
            self._tell(index, mode, arguments)

    def switch(self, mode: int) -> None:
        """Changes the control mode, and drops all targets.

        In position modes the robot then holds its measured positions. Under velocity control it does not move, and
        under torque control it moves freely.
        """
        self.mode = mode
        self._expiry.clear()
        self._renewed.clear()
        self.applied_efforts: dict[int, float] = {}
        self.impedance_setpoints: dict[int, tuple[float, float]] = {}
        states = self._pb.getJointStates(self._body_id, self._indices) if self._indices else ()
        is_held = mode in POSITION_MODES
        self.targets = {index: state[0] if is_held else 0.0 for index, state in zip(self._indices, states)}
        for index in self._indices:
            self._drive(index, self.targets[index])

    def set_gains(self, gains: MotorGains) -> None:
        """Changes motor gains from the next tick on. If the method raises, no gain has changed.

        Raises:
            UnknownNameError: If the robot lacks one of the joints.
            ValueError: If `gains` is empty, lengths differ, or a gain is negative or not finite.
        """
        changed: dict[int, dict[str, float]] = {}
        for key, values in (("positionGain", gains.position), ("velocityGain", gains.velocity)):
            for index, gain in (self._model.resolve_driven(gains.names, values) if values else {}).items():
                if gain < 0.0:
                    raise ValueError(f"{key} of '{self._model.joints[index].name}' must be >= 0, got {gain:g}")
                changed.setdefault(index, {})[key] = gain
        if not changed:
            raise ValueError("expected joints, and a position or velocity gain of each; got none")
        for index, arguments in changed.items():
            self._position_arguments[index].update(arguments)
            if "velocityGain" in arguments:
                self._velocity_arguments[index]["velocityGain"] = arguments["velocityGain"]
            self._drive(index, self.targets[index])

    def check(self, target: JointCommand) -> ResolvedCommand:
        """Checks a target for the present control mode, and resolves joint names. Any thread may call this method.

        Raises:
            UnknownNameError: If the robot lacks one of the joints.
            ValueError: If the target lacks the quantity that the mode needs, lengths differ, or a number is not finite.
        """
        mode = self.mode
        values = target.values_of(QUANTITIES[mode], f"the robot is under {MODE_NAMES[mode]}")
        # Also checks quantities that the mode does not use: a target with a non-finite number is refused.
        resolved = {
            quantity: self._model.resolve(target.names, given)
            for quantity in dict.fromkeys(QUANTITIES.values())
            if (given := getattr(target, quantity)) or given is values
        }
        velocities = resolved.get("velocity", {}) if mode in POSITION_MODES else {}
        return ResolvedCommand(mode, resolved[QUANTITIES[mode]], velocities, target.stamp_ns)

    def follow(self, command: ResolvedCommand) -> None:
        """Sets the motors to a target, clipped to the joints' limits.

        A target that was checked for another control mode is ignored.
        """
        if command.mode != self.mode:
            return
        for index, value in command.values.items():
            self.targets[index] = value = self.limited(index, value)
            if self.mode not in POSITION_MODES:
                self._renewed.add(index)
            if self.mode != pybullet.TORQUE_CONTROL:
                self._drive(index, value)

    def hold(self, positions: Mapping[int, float]) -> None:
        """Holds joints at positions.

        Args:
            positions: Positions [rad or m], keyed by joint index. They are not clipped to the joints' limits.
        """
        for index, position in positions.items():
            self.targets[index] = position
            self._drive(index, position)

    def track(self, index: int, position: float, velocity: float) -> None:
        """Makes a joint move with a velocity during the next tick, in any control mode. The arguments are not clipped.

        PyBullet's position motor drives at `velocity` plus a correction. The correction is the motor's gain times the
        difference between `position` and the measured position before the tick.

        Args:
            index: Joint index.
            position: Desired position [rad or m] before the tick.
            velocity: Velocity [rad/s or m/s] that leads to the desired position after the tick.
        """
        if self.mode == IMPEDANCE_CONTROL:
            self.impedance_setpoints[index] = position, velocity
        else:
            arguments = {"targetPosition": position, "targetVelocity": velocity, **self._position_arguments[index]}
            self._tell(index, pybullet.POSITION_CONTROL, arguments)
        if self.mode in POSITION_MODES:
            self.targets[index] = position + velocity * self._dt_s

    def release(self, indices: Iterable[int]) -> None:
        """Ends `track` for some joints; their motors then follow the control mode's targets again.

        In position modes the joints hold the last tracked position. Under velocity control they do not move.
        """
        for index in indices:
            if self.mode == pybullet.VELOCITY_CONTROL:
                self.targets[index] = 0.0
            self._drive(index, self.targets[index])

    def reset_setpoints(self, positions: Mapping[int, float]) -> None:
        """Resets set points after other code has set the positions of joints.

        In position modes the joints hold the new positions. In other modes velocities or efforts become 0.

        Args:
            positions: The new positions [rad or m], keyed by joint index.
        """
        for index, position in positions.items():
            self._expiry.pop(index, None)
            self._renewed.discard(index)
            self.targets[index] = position if self.mode in POSITION_MODES else 0.0
            self._drive(index, self.targets[index])

    def hold_measured(self, indices: Iterable[int]) -> None:
        """Resets set points to the measured positions of joints that a controller no longer drives.

        See `reset_setpoints` for the effect in each control mode.
        """
        states = {index: self._pb.getJointState(self._body_id, index)[0] for index in indices}
        for index in states:
            self.applied_efforts.pop(index, None)
        self.reset_setpoints(states)

    def disable(self, indices: Iterable[int]) -> None:
        """Switches off the PyBullet motors of joints, so that `apply_efforts` can drive the joints."""
        for index in indices:
            self._expiry.pop(index, None)
            self._renewed.discard(index)
            self._release(index)

    def apply_efforts(self, efforts: Mapping[int, float]) -> None:
        """Applies efforts for one tick, clipped to the joints' effort limits.

        Without `enforce_effort_limits` efforts are not clipped.

        Args:
            efforts: Efforts [N m or N], keyed by joint index.
        """
        limits = self._effort_limits
        limited = {index: min(max(effort, -limits[index]), limits[index]) for index, effort in efforts.items()}
        self._pb.setJointMotorControlArray(
            self._body_id, list(limited), pybullet.TORQUE_CONTROL, forces=list(limited.values())
        )
        self.applied_efforts.update(limited)

    @property
    def is_idle(self) -> bool:
        """Whether `before_step` has nothing to do, because no target expires and no efforts are applied each tick."""
        keeps = self.mode in (pybullet.POSITION_CONTROL, pybullet.VELOCITY_CONTROL)
        return keeps and not self._renewed and not self._expiry

    def before_step(self, tick: int, feed_forward: Mapping[int, float], driven_by_others: Collection[int] = ()) -> None:
        """Sets expired targets to 0. Under torque control, also applies the efforts of the tick.

        Args:
            tick: Number of the coming tick.
            feed_forward: Efforts [N m or N] added to effort targets under torque control, keyed by joint index.
            driven_by_others: Indices of joints to which no effort targets are applied.
        """
        if self._renewed:
            self._expiry.update(dict.fromkeys(self._renewed, tick + self._timeout_ticks))
            self._renewed.clear()
        if self._expiry:
            self._expire(tick)
        if self.mode == pybullet.TORQUE_CONTROL and self._indices:
            driven = [index for index in self._indices if index not in driven_by_others]
            self.apply_efforts({index: self.targets[index] + feed_forward.get(index, 0.0) for index in driven})

    def _expire(self, tick: int) -> None:
        for index in [index for index, expiry in self._expiry.items() if tick >= expiry]:
            del self._expiry[index]
            self.targets[index] = 0.0
            if self.mode == pybullet.VELOCITY_CONTROL:
                self._drive(index, 0.0)

    def limited(self, index: int, value: float) -> float:
        """Clips a target to the limits of a joint, and returns the result.

        In position modes, positions are clipped to the joint's range, and a warning is logged. Under velocity control,
        the URDF's velocity limit applies. Under torque control, the URDF's effort limit applies.

        Args:
            index: Joint index.
            value: Position [rad or m], velocity [rad/s or m/s] or effort [N m or N].
        """
        joint = self._model.joints[index]
        if self.mode in POSITION_MODES:
            self._limit_reports.observe(joint, value, "it goes to the limit")
            return self.nearest_allowed(index, value)
        if self.mode == pybullet.VELOCITY_CONTROL:
            return min(max(value, -joint.max_velocity), joint.max_velocity)
        return min(max(value, -self._effort_limits[index]), self._effort_limits[index])

    def nearest_allowed(self, index: int, position: float) -> float:
        """Clips a position [rad or m] to the limits of a joint, and returns the result."""
        return self._model.joints[index].nearest_allowed(position)

    def _drive(self, index: int, value: float) -> None:
        """Sends a set point to one of PyBullet's motors.

        Under torque and impedance control, switches the motor off instead.
        """
        if self.mode == pybullet.POSITION_CONTROL:
            arguments = {"targetPosition": value, **self._position_arguments[index]}
        elif self.mode == pybullet.VELOCITY_CONTROL:
            arguments = {"targetVelocity": value, **self._velocity_arguments[index]}
        else:
            self._release(index)
            return
        self._tell(index, self.mode, arguments)

    def _release(self, index: int) -> None:
        self._tell(index, pybullet.VELOCITY_CONTROL, {"force": 0.0})

    def _tell(self, index: int, mode: int, arguments: dict[str, Any]) -> None:
        self._told[index] = mode, arguments
        self._pb.setJointMotorControl2(self._body_id, index, mode, **arguments)

    def _arguments(self, joint: Joint, gains: Mapping[int, Mapping[str, float]]) -> dict[str, Any]:
        """Returns the arguments of a joint's position motor for PyBullet, without the set point."""
        arguments: dict[str, Any] = dict(gains.get(joint.index, {}))
        effort = self._model.effort_limit(joint)
        if self._enforce_effort_limits and math.isfinite(effort):
            arguments["force"] = effort
        if math.isfinite(joint.max_velocity):
            arguments["maxVelocity"] = joint.max_velocity
        return arguments
