"""Interface of safety checks, and the data that the guard passes to them."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np
from pydantic import Field

from custom_ros_tools.errors import ConfigError, Problem, UnknownNameError
from custom_ros_tools.schema import ConfigModel, Switch
from robot_model.collision.shapes import Obstacle
from robot_model.model import RobotModel
from safe_robot.motion import Bound

from .limits import MotionLimits
from .motion import CommandedMotion


class CheckConfig(ConfigModel):
    """Options that all checks have in common."""

    active: Switch = Field(True, description="Whether the check is used.")


class Violation(NamedTuple):
    """Reason why a target is not safe.

    Attributes:
        check: Name of the check.
        subject: Description of what is unsafe, for example a joint, a link or a pair of links.
        value: Value that the target would cause, in `unit`; NaN if the violation has no numbers.
        limit: Allowed value, in `unit`; NaN if the violation has no numbers.
        unit: Unit of `value` and `limit`.
        is_while_braking: Whether the braking after the target is unsafe, not the target itself.
        quantity: Name of the quantity that `value` and `limit` measure; empty if `subject` names the quantity.
        words: Message with advice. If empty, the message is generated from the other attributes.
    """

    check: str
    subject: str
    value: float
    limit: float
    unit: str
    is_while_braking: bool = False
    quantity: str = ""
    words: str = ""

    def __str__(self) -> str:
        if self.words or math.isnan(self.limit):
            return f"{self.check}: {self.words or self.subject}"
        subject = f"{self.subject}: {self.quantity}" if self.quantity else self.subject
        while_braking = " while braking" if self.is_while_braking else ""
        numbers = f"{self.value:.6g} {self.unit}, limit {self.limit:.6g} {self.unit}"
        return f"{self.check}: {subject}{while_braking} is {numbers}"


class MarginViolation(NamedTuple):
    """Two shapes whose distance is smaller than the safety margin.

    Attributes:
        check: Name of the check.
        pair: Names of two links, or the name of a link and the number of an obstacle.
        subject: Description of the two shapes, for messages.
        distance_m: Distance between the shapes [m].
        margin_m: Smallest allowed distance [m].
        gradient: Derivatives of the distance with respect to the joint positions, shape (n,) [m/rad or 1].
    """

    check: str
    pair: tuple[str, str | int]
    subject: str
    distance_m: float
    margin_m: float
    gradient: np.ndarray


class CheckContext(NamedTuple):
    """Inputs of checks in addition to the motion: times, measurements and obstacles.

    Attributes:
        now_s: Present time of a monotonic clock [s].
        age_s: Age of the target [s]; 0 if unknown.
        stamp_step_s: Stamp of the target minus stamp of the previous target [s]; None without a previous stamp.
        since_command_s: Time since the previous command [s]. For a repeated stamp: time since this stamp first arrived.
        measured: Measured positions, indexed by joint name [rad or m]; empty if there are none.
        measured_age_s: Age of the oldest measured position [s].
        wrench: Measured force x, y, z [N] and torque x, y, z [N m].
        wrench_age_s: Age of the wrench [s]; inf if there is no wrench.
        obstacles: Present bodies of the environment; None without a source of bodies. While no body changes, this is
            the same tuple object.
    """

    now_s: float = 0.0
    age_s: float = 0.0
    stamp_step_s: float | None = None
    since_command_s: float = 0.0
    measured: Mapping[str, float] = {}
    measured_age_s: float = 0.0
    wrench: tuple[float, ...] = (0.0,) * 6
    wrench_age_s: float = float("inf")
    obstacles: tuple[Obstacle, ...] | None = None


class Check(ABC):
    """Base class of checks, each of which decides whether a motion is safe.

    Results do not depend on earlier calls: equal motions and contexts have equal results. There is one exception: for
    an unsafe motion with `is_trial`, the choice of the reported violation may depend on earlier calls.

    Args:
        config: Options of the check.
        robot: The guarded robot.
        limits: Limits of the robot's n joints.
        file: Source of the options, for messages.

    Raises:
        ConfigError: If the options do not fit the robot.

    Attributes:
        Config: Pydantic class of the check's options.
        name: Name of the check in the configuration and in messages.
        is_default: Whether the check is used even without an entry in the configuration.
        watches: Whether the check examines the context instead of the command. Such a check also runs while no targets
            arrive.
        takes_obstacles: Whether the check uses `CheckContext.obstacles`.
    """

    Config: ClassVar[type[CheckConfig]] = CheckConfig
    name: ClassVar[str]
    is_default: ClassVar[bool] = False
    watches: ClassVar[bool] = False
    takes_obstacles: ClassVar[bool] = False

    def __init__(self, config: Any, robot: RobotModel, limits: MotionLimits, file: str) -> None:
        self.config, self.robot, self.limits, self.file = config, robot, limits, file

    @abstractmethod
    def check(self, motion: CommandedMotion, context: CheckContext) -> Violation | None:
        """Returns a violation if a motion is not safe; otherwise None.

        A motion with NaN is never safe. A robot that is outside a position limit may move back towards the limit.
        """

    def bounds(self, rows: np.ndarray, spread: np.ndarray, before: np.ndarray) -> Sequence[Bound]:
        """Returns linear bounds on positions that keep the robot safe near the given configurations.

        Called after `check`, and only with the policy `limit`. The bounds guide the search for a safe command. Each
        candidate command still has to pass `check`.

        Args:
            rows: Configurations during braking, shape (k, n) [rad or m].
            spread: Largest deviations from the configurations, shape (n,) [rad or m]. Bounds that these deviations
                cannot reach may be left out.
            before: Present positions, shape (n,) [rad or m]. Violations that exist at these positions may not increase.
        """
        return ()

    def inside(self, q: np.ndarray) -> Sequence[MarginViolation]:
        """Returns the margin violations at n joint positions [rad or m].

        Obstacles are those of the last `check` call.
        """
        return ()

    def require_link(self, link: str, key: str) -> None:
        """Raises a ConfigError if an option names a link that the robot does not have."""
        try:
            self.robot.check_link(link)
        except UnknownNameError as error:
            raise ConfigError([Problem(self.file, f"checks.{self.name}.{key}.{link}", str(error))]) from None

    def first_above(
        self, values: np.ndarray, limit: np.ndarray, quantity: str, unit: tuple[str, str]
    ) -> Violation | None:
        """Returns the violation for the first value that exceeds its limit; None if all values keep their limits.

        Args:
            values: Absolute values for n joints in k rows of a motion, shape (k, n).
            limit: Limits, shape (n,) or (k, n).
            quantity: Name of the quantity, for the violation.
            unit: The unit for revolute joints, and the unit for prismatic joints.
        """
        is_inside = values <= limit
        if is_inside.all():
            return None
        row, i = divmod(int(np.argmin(is_inside)), values.shape[1])
        most = float(np.broadcast_to(limit, values.shape)[row, i])
        return self.of_joint(i, float(values[row, i]), most, quantity, unit, row > 0)

    def of_joint(
        self, i: int, value: float, limit: float, quantity: str, unit: tuple[str, str], is_while_braking: bool
    ) -> Violation:
        """Returns the violation for the joint with index `i`; see `Violation` and, for `unit`, `first_above`."""
        which = unit[0] if self.robot.joints[i].is_revolute else unit[1]
        subject = f"joint '{self.robot.joint_names[i]}'"
        return Violation(self.name, subject, value, limit, which, is_while_braking, quantity)
