"""Base class of controllers, which turn the state of a robot into efforts or set points, tick by tick."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt
from pydantic import Field

from custom_ros_tools.schema import ConfigModel, HzOrOff, ListOf, Switch, Text
from rpbi.control.robot_dynamics import RobotDynamics
from rpbi.geometry import Pose, Twist

Array = npt.NDArray[np.float64]


class ControllerConfig(ConfigModel):
    """An entry of a robot's `controllers`; a controller with more keys has a subclass of this as its `Config`."""

    type: Text = Field(description="Its type: a key of CONTROLLERS, or `module:Class`.")
    active: Switch = Field(True, description="Whether it drives its joints from the start on.")
    joints: ListOf[Text] | None = Field(None, description="The joints that it drives; all, if they are not named.")
    state_hz: HzOrOff = Field(50.0, description="Rate of its state; 0 is off.")


class RobotState(NamedTuple):
    """The measured state of a robot before a tick.

    Attributes:
        base: Pose of the root link in the world.
        position: Positions of all n driven joints [rad or m], in the order of `RobotDynamics.joints`.
        velocity: Their velocities [rad/s or m/s].
        base_twist: Twist of the root link in the world; 0 where the base is fixed.
    """

    base: Pose
    position: tuple[float, ...]
    velocity: tuple[float, ...]
    base_twist: Twist = Twist()


class SetPoints(NamedTuple):
    """Positions of a controller's joints after the tick, to which PyBullet's motors move them.

    Attributes:
        position: One for each of its joints [rad or m].
    """

    position: Array


class ControlledRobot(NamedTuple):
    """The robot of a controller, and its part of it.

    Attributes:
        name: The robot.
        link_pose: Returns the measured pose in the world of the URDF frame of a link, by PyBullet's index.
        model: Its dynamics and kinematics.
        links: PyBullet's indices of its links by name.
        chosen: The places of the controller's joints among the driven ones, shape (m,).
        dt_s: Length of a tick [s].
    """

    name: str
    link_pose: Callable[[int], Pose]
    model: RobotDynamics
    links: Mapping[str, int]
    chosen: npt.NDArray[np.int64]
    dt_s: float

    def of_chosen(self, rows: Array) -> Array:
        """Returns the entries of the controller's joints, along the last axis of an array for all driven joints."""
        return rows if len(self.chosen) == len(self.model.joints) else rows[..., self.chosen]


class Controller(ABC):
    """Drives some joints of one robot, on the simulation thread, before the physics of each tick.

    A new one is a subclass with a `Config` and `compute`; see docs/controllers.md.

    Args:
        arm: The robot.
        config: Its keys in YAML.

    Raises:
        ValueError: If they do not fit each other.
    """

    Config: ClassVar[type[ControllerConfig]] = ControllerConfig
    inputs: ClassVar[Mapping[str, str]] = {}
    """Place of the Topic of each input, as `module:NAME`, by the input's name in `targets`."""

    def __init__(self, arm: ControlledRobot, config: Any) -> None:
        self.arm = arm
        self.config = config

    def check(self, key: str, value: Any) -> Any:
        """Returns the entry of `targets` for a value received by topic; any thread calls it.

        Raises:
            ValueError: If the value is refused.
        """
        return value

    def start(self, state: RobotState, tick: int) -> None:  # noqa: B027 (many need nothing)
        """Begins, before the first `compute`, from the measured state."""

    @abstractmethod
    def compute(self, state: RobotState, targets: Mapping[str, Any], tick: int) -> Array | SetPoints:
        """Returns the efforts [N m or N] of its m joints, shape (m,), or set points, for one tick.

        Args:
            state: The robot before the tick.
            targets: The newest value of each input that came since the start, by name.
            tick: The world's tick.
        """

    def report(self) -> Mapping[str, float]:
        """Returns numbers for its state topic, by name."""
        return {}
