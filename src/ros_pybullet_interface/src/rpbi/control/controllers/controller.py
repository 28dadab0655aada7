"""Base class of controllers. A controller computes efforts or set points from a robot's state at each tick."""

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
    """Keys that every entry of a robot's `controllers` has; a controller adds its own keys in a subclass."""

    type: Text = Field(description="Type of the controller: a key of CONTROLLERS, or `module:Class`.")
    active: Switch = Field(True, description="Whether the controller is active from the start of the world.")
    joints: ListOf[Text] | None = Field(
        None, description="Joints that the controller drives. By default, all driven joints of the robot."
    )
    state_hz: HzOrOff = Field(50.0, description="Rate of the controller's state topic; 0 is off.")


class RobotState(NamedTuple):
    """The measured state of a robot before a tick.

    Attributes:
        base: Pose of the root link in the world frame.
        position: Positions [rad or m] of all n driven joints, in the order of `RobotDynamics.joints`.
        velocity: Velocities [rad/s or m/s] of the same joints, in the same order.
        base_twist: Twist of the root link in the world frame; zero for a fixed base.
    """

    base: Pose
    position: tuple[float, ...]
    velocity: tuple[float, ...]
    base_twist: Twist = Twist()


class SetPoints(NamedTuple):
    """Joint positions that a controller commands; PyBullet's motors move the joints to these positions within a tick.

    Attributes:
        position: Positions [rad or m] of the controller's m joints at the end of the tick, shape (m,).
    """

    position: Array


class ControlledRobot(NamedTuple):
    """The data that a controller gets about its robot, including which joints the controller drives.

    Attributes:
        name: Name of the robot.
        link_pose: Function from PyBullet's link index to the measured pose of the link's URDF frame in the world frame.
        model: Dynamics and kinematics of the robot.
        links: PyBullet's link indices, keyed by link name.
        chosen: Indices of the controller's m joints in `model.joints`, shape (m,).
        dt_s: Length of a tick [s].
    """

    name: str
    link_pose: Callable[[int], Pose]
    model: RobotDynamics
    links: Mapping[str, int]
    chosen: npt.NDArray[np.int64]
    dt_s: float

    def of_chosen(self, rows: Array) -> Array:
        """Selects the controller's joints along the last axis of an array.

        Args:
            rows: Array with one entry per driven joint of the robot on its last axis.
        """
        return rows if len(self.chosen) == len(self.model.joints) else rows[..., self.chosen]


class Controller(ABC):
    """Base class of controllers. Computes the commands of some joints of one robot before the physics of each tick.

    A subclass defines `Config` and `compute`; see docs/controllers.md. The simulation thread makes all calls except
    those of `check`.

    Args:
        arm: The robot and the joints to drive.
        config: The controller's configuration, an instance of `Config`.

    Raises:
        ValueError: If the configuration does not fit the robot.
    """

    Config: ClassVar[type[ControllerConfig]] = ControllerConfig
    inputs: ClassVar[Mapping[str, str]] = {}
    """Import path `module:NAME` of each input's Topic, keyed by the input's name in `targets`."""

    def __init__(self, arm: ControlledRobot, config: Any) -> None:
        self.arm = arm
        self.config = config

    def check(self, key: str, value: Any) -> Any:
        """Checks a value received on a topic, and returns the value to store in `targets`.

        Any thread may call this method.

        Args:
            key: Name of the input.
            value: The received value.

        Raises:
            ValueError: If the value is refused.
        """
        return value

    def start(self, state: RobotState, tick: int) -> None:  # noqa: B027 (many need nothing)
        """Initializes the controller from the measured state, before the first `compute` after each activation."""

    @abstractmethod
    def compute(self, state: RobotState, targets: Mapping[str, Any], tick: int) -> Array | SetPoints:
        """Computes one tick's commands: efforts [N m or N] of the controller's m joints, shape (m,), or set points.

        Args:
            state: State of the robot before the tick.
            targets: Newest value of each input received since the last call of `start`, keyed by the input's name.
            tick: Number of the simulation tick.
        """

    def report(self) -> Mapping[str, float]:
        """Returns the numbers that the controller's state topic publishes, keyed by name."""
        return {}
