"""Starts, runs and stops the controllers of one robot, and stops controllers that fail."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from custom_ros_tools.errors import InterfaceError, Problem, UnknownNameError
from rpbi.control.motors import Motors
from rpbi.plugins import raise_plugin_error

from . import CONTROLLERS
from .controller import ControlledRobot, Controller, ControllerConfig, RobotState, SetPoints

log = logging.getLogger(__name__)

SLOW_TICKS = 50
"""Number of consecutive ticks with a computation longer than the tick, after which a controller is stopped."""


class ControllerStateSample(NamedTuple):
    """State of a controller, for its state topic.

    Attributes:
        name: `ROBOT/CONTROLLER`.
        type: Type of the controller, as in YAML.
        active: Whether the controller drives its joints.
        message: Error that stopped the controller; empty without an error.
        values: Numbers that `Controller.report` returned, keyed by name.
    """

    name: str
    type: str
    active: bool
    message: str
    values: Mapping[str, float]


class ControllerSwitch(NamedTuple):
    """Request to stop some controllers and then start others.

    Attributes:
        start: Names of the controllers to start.
        stop: Names of the controllers to stop.
    """

    start: Sequence[str] = ()
    stop: Sequence[str] = ()


class ControllerUpdate(NamedTuple):
    """Request to replace a controller's configuration.

    Attributes:
        name: Name of the controller.
        config: The complete new configuration.
    """

    name: str
    config: ControllerConfig


class _Managed:
    """A controller with its activation state, targets and timing."""

    not_in_keyframes = ("slow",)

    def __init__(self, name: str, robot: ControlledRobot, config: ControllerConfig) -> None:
        self.name, self.robot = name, robot
        self.indices = [robot.model.joints[place].index for place in robot.chosen]
        self.targets: dict[str, Any] = {}
        self.active = self.has_begun = False
        self.message = ""
        self.slow = 0
        self.configure(config)

    def configure(self, config: ControllerConfig) -> None:
        """Replaces the controller by a new one, which starts at the next tick if the old controller was active."""
        self.controller = CONTROLLERS.find(config.type)(self.robot, config)
        self.config = config
        self.has_begun = False

    def compute(self, state: RobotState, tick: int) -> np.ndarray | SetPoints:
        """Runs the controller for one tick, and returns its efforts or set points after checking shape and finiteness.

        Raises:
            ValueError: If the output has a wrong shape or is not finite.
            Exception: Whatever the controller raises.
        """
        if not self.has_begun:
            self.controller.start(state, tick)
            self.has_begun = True
        wanted = self.controller.compute(state, self.targets, tick)
        numbers = np.asarray(wanted.position if isinstance(wanted, SetPoints) else wanted, np.float64)
        if numbers.shape != (len(self.indices),):
            raise ValueError(
                f"expected one number for each of its {len(self.indices)} joints, got shape {numbers.shape}"
            )
        if not all(map(math.isfinite, numbers.tolist())):  # twice as fast as numpy for the joints of an arm
            raise ValueError(f"the output is not finite: {numbers.tolist()}")
        return SetPoints(numbers) if isinstance(wanted, SetPoints) else numbers


class ControllerManager:
    """Runs the active controllers of one robot. At most one controller drives a joint.

    Args:
        robot: The robot. For each controller, the field `chosen` is replaced by the joints in the configuration.
        configs: Configurations, keyed by the controller's name.
        motors: The robot's motors.

    Raises:
        ConfigError: If a configuration does not fit the robot.
    """

    def __init__(self, robot: ControlledRobot, configs: Mapping[str, ControllerConfig], motors: Motors) -> None:
        self._motors = motors
        self._robot = robot
        self._managed = {name: _Managed(name, self._with_joints_of(config), config) for name, config in configs.items()}
        self.driven: frozenset[int] = frozenset()
        """PyBullet's indices of the joints that an active controller drives."""
        self.switch(ControllerSwitch([name for name, config in configs.items() if config.active], []))

    @property
    def names(self) -> list[str]:
        """The names of all controllers."""
        return list(self._managed)

    def of(self, name: str) -> Controller:
        """Returns the controller with the given name.

        Raises:
            UnknownNameError: If the name is unknown.
        """
        return self._named(name).controller

    def is_active(self, name: str) -> bool:
        """Returns whether a controller drives its joints.

        Raises:
            UnknownNameError: If the name is unknown.
        """
        return self._named(name).active

    def check_switch(self, switch: ControllerSwitch) -> None:
        """Checks that controllers can be started and stopped as requested.

        Raises:
            UnknownNameError: If a name is unknown.
            ValueError: If two controllers would drive the same joint.
        """
        for name in (*switch.start, *switch.stop):
            self._named(name)
        drivers: dict[int, str] = {}
        for name in self._after(switch):
            for index in self._managed[name].indices:
                if index in drivers:
                    joint = next(joint.name for joint in self._robot.model.joints if joint.index == index)
                    raise ValueError(f"'{name}' and '{drivers[index]}' both drive '{joint}': stop one of them")
                drivers[index] = name

    def switch(self, switch: ControllerSwitch) -> frozenset[int]:
        """Stops and starts controllers. Joints that lose their controller hold their measured positions.

        Returns:
            PyBullet's indices of the joints that a controller drives now but did not drive before.

        Raises:
            UnknownNameError: If a name is unknown.
            ValueError: If two controllers would drive the same joint. In this case no controller was switched.
        """
        self.check_switch(switch)
        active = self._after(switch)
        before = self.driven
        for name, managed in self._managed.items():
            if managed.active != (name in active):
                managed.active, managed.has_begun, managed.message, managed.slow = name in active, False, "", 0
                managed.targets.clear()
        self._drive_others(before)
        return self.driven - before

    def configure(self, update: ControllerUpdate) -> None:
        """Replaces the configuration of a controller, for example to change its gains.

        Raises:
            UnknownNameError: If the controller's name is unknown.
            ValueError: If the configuration does not fit the robot.
        """
        self._named(update.name).configure(update.config)

    def config(self, name: str) -> ControllerConfig:
        """Returns the configuration of a controller.

        Raises:
            UnknownNameError: If the name is unknown.
        """
        return self._named(name).config

    def set_target(self, name: str, key: str, value: Any) -> None:
        """Sets the value of an input of a controller.

        Args:
            name: Name of the controller.
            key: Name of the input.
            value: Value that `Controller.check` returned.
        """
        self._managed[name].targets[key] = value

    def advance(self, state: RobotState, tick: int) -> None:
        """Runs the active controllers for one tick. A controller that fails is stopped, and its error is logged."""
        for managed in self._managed.values():
            if managed.active:
                self._advance(managed, state, tick)

    def sample(self, robot: str, name: str) -> ControllerStateSample:
        """Returns the state of a controller. If the controller's `report` fails, stops the controller first.

        Args:
            robot: Name of the robot.
            name: Name of the controller.
        """
        managed = self._managed[name]
        values: Mapping[str, float] = {}
        if managed.active and managed.has_begun:
            try:
                values = {str(key): float(value) for key, value in managed.controller.report().items()}
                if wrong := [key for key, value in values.items() if not math.isfinite(value)]:
                    raise ValueError(f"reported numbers are not finite: {', '.join(wrong)}")
            except Exception as error:
                self._fail(managed, _cause(managed.controller, "report", error))
                values = {}
        return ControllerStateSample(f"{robot}/{name}", managed.config.type, managed.active, managed.message, values)

    def _advance(self, managed: _Managed, state: RobotState, tick: int) -> None:
        begin_ns, used_ns = time.perf_counter_ns(), time.thread_time_ns() if managed.slow else 0
        try:
            wanted = managed.compute(state, tick)
        except Exception as error:
            self._fail(managed, _cause(managed.controller, "compute", error))
            return
        took_s = (time.perf_counter_ns() - begin_ns) * 1e-9
        if managed.slow and took_s > managed.robot.dt_s:  # then measure processor time, which is slower to read
            took_s = (time.thread_time_ns() - used_ns) * 1e-9
        managed.slow = managed.slow + 1 if took_s > managed.robot.dt_s else 0
        if managed.slow >= SLOW_TICKS:
            self._fail(managed, f"it needs {took_s * 1e3:.3g} ms for a tick of {managed.robot.dt_s * 1e3:.3g} ms")
        elif isinstance(wanted, SetPoints):
            measured = (state.position[place] for place in managed.robot.chosen)
            for index, before, after in zip(managed.indices, measured, wanted.position.tolist()):
                self._motors.track(index, before, (after - before) / managed.robot.dt_s)
        else:
            self._motors.apply_efforts(dict(zip(managed.indices, wanted.tolist())))

    def _fail(self, managed: _Managed, message: str) -> None:
        log.error("%s: controller '%s' is stopped, its joints hold: %s", self._robot.name, managed.name, message)
        before = self.driven
        managed.active, managed.message = False, message
        self._drive_others(before)

    def _drive_others(self, before: frozenset[int]) -> None:
        """Updates `driven`, the indices of the joints that controllers drive; `before` is the previous value.

        Joints that are no longer driven hold. PyBullet's motors of newly driven joints are disabled.
        """
        self.driven = frozenset(
            index for managed in self._managed.values() if managed.active for index in managed.indices
        )
        self._motors.hold_measured(before - self.driven)
        self._motors.disable(self.driven - before)

    def _after(self, switch: ControllerSwitch) -> list[str]:
        """Returns the names of the controllers that are active after a switch."""
        stays = {name for name, managed in self._managed.items() if managed.active} - set(switch.stop)
        return [name for name in self._managed if name in stays or name in switch.start]

    def _named(self, name: str) -> _Managed:
        if name not in self._managed:
            raise UnknownNameError("controller", name, list(self._managed))
        return self._managed[name]

    def _with_joints_of(self, config: ControllerConfig) -> ControlledRobot:
        return self._robot._replace(chosen=chosen_joints(self._robot, config.joints))


def chosen_joints(robot: ControlledRobot, names: Iterable[str] | None) -> np.ndarray:
    """Returns the indices of the named joints in `robot.model.joints`, shape (m,).

    Args:
        names: m joint names; None for all driven joints.

    Raises:
        UnknownNameError: If a name does not belong to a driven joint.
    """
    known = [joint.name for joint in robot.model.joints]
    if names is None:
        return np.arange(len(known))
    for name in names:
        if name not in known:
            raise UnknownNameError("driven joint", name, known)
    return np.array([known.index(name) for name in names], np.int64)


def _cause(controller: Controller, doing: str, error: Exception) -> str:
    """Returns the message of an error; names the controller's class if this class is from another package."""
    try:
        raise_plugin_error(controller, doing, error)
    except InterfaceError as named:
        return str(named)
    return f"{type(error).__name__}: {error}"


def controller_problems(robot: ControlledRobot, configs: Mapping[str, ControllerConfig]) -> list[Problem]:
    """Returns the problems in the configurations of a robot's controllers."""
    problems = []
    drivers: dict[int, str] = {}
    for name, config in configs.items():
        key = f"controllers.{name}"
        try:
            chosen = chosen_joints(robot, config.joints)
            CONTROLLERS.find(config.type)(robot._replace(chosen=chosen), config)
        except (InterfaceError, ValueError) as error:
            problems.append(Problem(robot.name, key, str(error)))
            continue
        for place in chosen.tolist() if config.active else ():
            if place in drivers:
                joint = robot.model.joints[place].name
                problems.append(
                    Problem(robot.name, key, f"'{drivers[place]}' drives '{joint}' already: only one is active")
                )
                break
            drivers[place] = name
    return problems
