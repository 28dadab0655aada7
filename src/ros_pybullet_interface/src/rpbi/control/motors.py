"""The motors of a robot: control modes, set points, and how long they last."""

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
"""Shortest time between two reports of one joint [s] of wall time."""


class LimitReports:
    """Logs when a joint exceeds its limits, once until it is back, and at most once in `PERIOD_S`."""

    not_in_keyframes = ("_beyond", "_reported_s")

    def __init__(self, robot_name: str) -> None:
        self._robot_name = robot_name
        self._beyond: set[int] = set()
        self._reported_s: dict[int, float] = {}

    def observe(self, joint: Joint, position: float, what: str) -> None:
        """Checks a position [rad or m]; `what` is the consequence for the log line, such as `it goes to the limit`."""
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
"""Quantity of a target in each control mode."""
MAX_WAITING_TARGETS = 100
"""Largest number of targets that wait for one tick; beyond it, the last ones are merged."""
MODE_NAMES = {CONTROL_MODES.parse(name): name for name in CONTROL_MODES.names}
POSITION_MODES = (pybullet.POSITION_CONTROL, IMPEDANCE_CONTROL)
"""Modes in which targets are positions, which never expire."""


class ResolvedCommand(NamedTuple):
    """A target checked for a control mode.

    Attributes:
        mode: The control mode.
        values: Positions, velocities or efforts by joint index.
        velocities: With positions, the velocities there, for the same joints; may be empty.
        stamp_ns: Time of sending by the sender's clock [ns], 0 if unknown.
    """

    mode: int
    values: dict[int, float]
    velocities: Mapping[int, float] = {}
    stamp_ns: int = 0

    def merged(self, newer: ResolvedCommand) -> ResolvedCommand:
        """Merges both: the newer one replaces the older joint by joint, or as a whole if the mode changed between
        them."""
        return newer._replace(values=self.values | newer.values, velocities={}) if self.mode == newer.mode else newer


def coalesce(older: tuple[ResolvedCommand, ...], newer: tuple[ResolvedCommand, ...]) -> tuple[ResolvedCommand, ...]:
    """Returns the commands of both, the last ones merged if there are too many."""
    if len(older) < MAX_WAITING_TARGETS:
        return older + newer
    return (*older[:-1], older[-1].merged(*newer))


class MotorGains(NamedTuple):
    """Gains of some joints.

    Attributes:
        names: The joints.
        position: PyBullet's position gain of each; empty to leave them as they are.
        velocity: PyBullet's velocity gain of each; empty to leave them as they are.
    """

    names: Sequence[str]
    position: Sequence[float] = ()
    velocity: Sequence[float] = ()


class Motors:
    """Drives the joints of one robot within the efforts and velocities of its URDF.

    Positions hold until the next target. Velocities and efforts that are not renewed return to 0 after some simulated
    time: the robot stops when its sender stops.

    Args:
        gains: PyBullet's `positionGain` and `velocityGain` by joint index, where they are not PyBullet's own.
        enforce_effort_limits: Whether motors are held to the efforts of the URDF.
        timeout_s: Age at which velocity and effort targets expire [s] of the world's time.

    Attributes:
        targets: Set points of the motors by joint index: positions, velocities or efforts, by the control mode.
        impedance_setpoints: Position [rad or m] and velocity for springs to hold at the coming tick, by joint index,
            where they differ from the targets.
        applied_efforts: Efforts [N m or N] by joint index that torque targets, springs or a controller applied in the
            last tick; PyBullet does not report them.
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
        """Tick at which the target of a joint expires, by joint index."""
        self._renewed: set[int] = set()
        self._told: dict[int, tuple[int, dict[str, Any]]] = {}
        """The mode of PyBullet's motor of each joint, and its newest arguments; PyBullet keeps them."""
        self.switch(mode)

    def resume(self) -> None:
        """Sends the newest arguments of all motors again, to another client that has the same robot."""
        for index, (mode, arguments) in self._told.items():
            self._tell(index, mode, arguments)

    def switch(self, mode: int) -> None:
        """Changes the control mode: the robot holds its position, or under torque control moves freely."""
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
        """Changes gains from the coming tick on; when it raises, nothing has changed.

        Raises:
            UnknownNameError: If the robot lacks one of the joints.
            ValueError: If there is nothing to change, lengths differ or a gain is negative or not finite.
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
        """Checks a target against the present control mode; any thread may call it.

        Raises:
            UnknownNameError: If the robot lacks one of the joints.
            ValueError: If the target has nothing for this mode, lengths differ or a number is not finite.
        """
        mode = self.mode
        values = target.values_of(QUANTITIES[mode], f"the robot is under {MODE_NAMES[mode]}")
        # also checks quantities that are not used: a target with a non-finite number is refused
        resolved = {
            quantity: self._model.resolve(target.names, given)
            for quantity in dict.fromkeys(QUANTITIES.values())
            if (given := getattr(target, quantity)) or given is values
        }
        velocities = resolved.get("velocity", {}) if mode in POSITION_MODES else {}
        return ResolvedCommand(mode, resolved[QUANTITIES[mode]], velocities, target.stamp_ns)

    def follow(self, command: ResolvedCommand) -> None:
        """Follows a target from now on, unless the control mode has changed since it was checked."""
        if command.mode != self.mode:
            return
        for index, value in command.values.items():
            self.targets[index] = value = self.limited(index, value)
            if self.mode not in POSITION_MODES:
                self._renewed.add(index)
            if self.mode != pybullet.TORQUE_CONTROL:
                self._drive(index, value)

    def hold(self, positions: Mapping[int, float]) -> None:
        """Holds joints by index at positions [rad or m], which are within their limits."""
        for index, position in positions.items():
            self.targets[index] = position
            self._drive(index, position)

    def track(self, index: int, position: float, velocity: float) -> None:
        """Sets a joint's position [rad or m] and velocity [rad/s or m/s] at the coming tick, in any control mode.

        PyBullet's position motor moves by the velocity, plus its gain times the difference to the position before the
        tick. `position` is therefore the one before the tick; `velocity` leads to the desired one after it.
        """
        if self.mode == IMPEDANCE_CONTROL:
            self.impedance_setpoints[index] = position, velocity
        else:
            arguments = {"targetPosition": position, "targetVelocity": velocity, **self._position_arguments[index]}
            self._tell(index, pybullet.POSITION_CONTROL, arguments)
        if self.mode in POSITION_MODES:
            self.targets[index] = position + velocity * self._dt_s

    def release(self, indices: Iterable[int]) -> None:
        """Ends tracking: joints hold their last position, or stand still under velocity control."""
        for index in indices:
            if self.mode == pybullet.VELOCITY_CONTROL:
                self.targets[index] = 0.0
            self._drive(index, self.targets[index])

    def reset_setpoints(self, positions: Mapping[int, float]) -> None:
        """Resets set points after joints were put at positions [rad or m], by index: held there, or not driven."""
        for index, position in positions.items():
            self._expiry.pop(index, None)
            self._renewed.discard(index)
            self.targets[index] = position if self.mode in POSITION_MODES else 0.0
            self._drive(index, self.targets[index])

    def hold_measured(self, indices: Iterable[int]) -> None:
        """Holds joints by index at their measured positions, after a controller has driven them."""
        states = {index: self._pb.getJointState(self._body_id, index)[0] for index in indices}
        for index in states:
            self.applied_efforts.pop(index, None)
        self.reset_setpoints(states)

    def disable(self, indices: Iterable[int]) -> None:
        """Switches PyBullet's motors of joints off, by index, for `apply_efforts`."""
        for index in indices:
            self._expiry.pop(index, None)
            self._renewed.discard(index)
            self._release(index)

    def apply_efforts(self, efforts: Mapping[int, float]) -> None:
        """Applies efforts [N m or N] by joint index for one tick, within the joints' own."""
        limits = self._effort_limits
        limited = {index: min(max(effort, -limits[index]), limits[index]) for index, effort in efforts.items()}
        self._pb.setJointMotorControlArray(
            self._body_id, list(limited), pybullet.TORQUE_CONTROL, forces=list(limited.values())
        )
        self.applied_efforts.update(limited)

    @property
    def is_idle(self) -> bool:
        """Whether no target expires, and no effort has to be applied at each tick."""
        keeps = self.mode in (pybullet.POSITION_CONTROL, pybullet.VELOCITY_CONTROL)
        return keeps and not self._renewed and not self._expiry

    def before_step(self, tick: int, feed_forward: Mapping[int, float], driven_by_others: Collection[int] = ()) -> None:
        """Lets targets expire, and applies efforts, which PyBullet keeps for one tick only.

        Args:
            feed_forward: Efforts [N m or N] by joint index that are added to the targets under torque control.
            driven_by_others: Joints by index that are left alone.
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
        """Returns a position, velocity or effort clipped to the limits of the joint."""
        joint = self._model.joints[index]
        if self.mode in POSITION_MODES:
            self._limit_reports.observe(joint, value, "it goes to the limit")
            return self.nearest_allowed(index, value)
        if self.mode == pybullet.VELOCITY_CONTROL:
            return min(max(value, -joint.max_velocity), joint.max_velocity)
        return min(max(value, -self._effort_limits[index]), self._effort_limits[index])

    def nearest_allowed(self, index: int, position: float) -> float:
        """Returns the position [rad or m] within the limits of a joint that is nearest to one."""
        return self._model.joints[index].nearest_allowed(position)

    def _drive(self, index: int, value: float) -> None:
        """Sets the set point of one motor; PyBullet keeps it. Under torque control and impedance it is released."""
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
        """Returns the arguments of PyBullet's position motor of a joint, except its set point."""
        arguments: dict[str, Any] = dict(gains.get(joint.index, {}))
        effort = self._model.effort_limit(joint)
        if self._enforce_effort_limits and math.isfinite(effort):
            arguments["force"] = effort
        if math.isfinite(joint.max_velocity):
            arguments["maxVelocity"] = joint.max_velocity
        return arguments
