"""The interface of checks."""

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
    """Options that every check has."""

    active: Switch = Field(True, description="Whether the check is used.")


class Violation(NamedTuple):
    """Reason why a target is not safe.

    Attributes:
        check: Name of the check.
        subject: The joint, link, pair of links, or another subject.
        value: Value that the target would cause, in `unit`; NaN, as `limit`, if there is no number.
        limit: Allowed value, in `unit`.
        unit: The unit of both.
        is_while_braking: Whether the braking after the target is unsafe, not the target itself.
        quantity: Quantity of value and limit; empty if the subject is itself a quantity.
        words: Text with advice, which replaces the sentence made of the other attributes.
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
    """A pair that is nearer than its margin.

    Attributes:
        check: Name of the check.
        pair: The pair, in the check's own terms.
        subject: The pair, for messages.
        distance_m: Distance [m].
        margin_m: Smallest allowed distance [m].
        gradient: Change of distance by the motion of each of n joints [m/rad or 1].
    """

    check: str
    pair: tuple[str, str | int]
    subject: str
    distance_m: float
    margin_m: float
    gradient: np.ndarray


class CheckContext(NamedTuple):
    """Context of a motion for the checks of a target.

    Attributes:
        now_s: The present time [s], of a clock that never goes back.
        age_s: Age of the target [s]; 0 if unknown.
        stamp_step_s: Difference from the previous target's stamp [s]; None without one.
        since_command_s: Time since the previous command [s]; for a repeated stamp, time since that stamp was new.
        measured: Measured positions by joint [rad or m], empty if there are none.
        measured_age_s: Their age [s].
        wrench: Measured force x, y, z [N] and torque x, y, z [N m].
        wrench_age_s: Its age [s]; inf if there is none.
        obstacles: Present bodies of the environment; None without a source. Equal ones are the same tuple.
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
    """A check of motions.

    It is stateless: equal motions have equal answers. For trials, only the verdict has to be equal.

    Args:
        config: Its options.
        robot: The robot.
        limits: Limits of its n joints.
        file: Source of the options, for messages.

    Raises:
        ConfigError: If the options do not fit the robot.

    Attributes:
        Config: Model of its options.
        name: Its name in the table and in messages.
        is_default: Whether it is used by default, without an entry in the configuration.
        watches: Whether it checks the context, not the command; such checks also run while no target comes.
        takes_obstacles: Whether it uses `CheckContext.obstacles`.
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
        """Returns the violation of a motion, None if it is safe.

        NaN is never safe. A robot outside a position limit may move back towards it.
        """

    def bounds(self, rows: np.ndarray, spread: np.ndarray, before: np.ndarray) -> Sequence[Bound]:
        """Returns linear bounds that keep the robot safe near some configurations of its braking.

        Only for the policy `limit`, after `check`. They only guide the search for a command that passes `check`.

        Args:
            rows: The configurations, k x n positions [rad or m].
            spread: Largest deviation of n joints from there; bounds beyond it may be left out.
            before: n present positions: violations there may not increase.
        """
        return ()

    def inside(self, q: np.ndarray) -> Sequence[MarginViolation]:
        """Returns the margin violations in a configuration of n positions; it is called after `check`."""
        return ()

    def require_link(self, link: str, key: str) -> None:
        """Raises a ConfigError if an option names a link that the robot lacks."""
        try:
            self.robot.check_link(link)
        except UnknownNameError as error:
            raise ConfigError([Problem(self.file, f"checks.{self.name}.{key}.{link}", str(error))]) from None

    def first_above(
        self, values: np.ndarray, limit: np.ndarray, quantity: str, unit: tuple[str, str]
    ) -> Violation | None:
        """Returns a violation of the first of k x n values that exceeds its limit; None if none does.

        Args:
            values: Values, none negative.
            limit: n limits, or k x n.
            quantity: Name of the quantity.
            unit: The unit for a joint that turns, and for one that slides.
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
        """Returns the violation of a joint."""
        which = unit[0] if self.robot.joints[i].is_revolute else unit[1]
        subject = f"joint '{self.robot.joint_names[i]}'"
        return Violation(self.name, subject, value, limit, which, is_while_braking, quantity)
