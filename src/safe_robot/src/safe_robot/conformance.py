"""Tests that every check has to pass; packages that define checks may subclass `CheckConformance`."""

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import pytest

from custom_ros_tools.errors import ConfigError
from robot_model.model import RobotModel

from .check import Check, CheckContext
from .checks import make_checks
from .limits import LimitsConfig, MotionLimits
from .motion import CommandedMotion, State


class CheckConformance:
    """Tests that every check has to pass.

    A subclass names a check, the check's options and a robot, and provides one safe and one unsafe motion.

    Attributes:
        check_name: Name of the check in `CHECKS`, or `"their_package.module:Class"`.
        options: Options of the check.
        limits: Limits of the robot's joints, as in `LimitsConfig`.
        urdf: Path of the robot's URDF.
        period_s: Period of the motions [s].
        is_about_motion: Whether the check examines the motion; otherwise it examines only the context.
    """

    check_name: ClassVar[str]
    options: ClassVar[Mapping[str, Any]] = {}
    limits: ClassVar[Mapping[str, Any]] = {}
    urdf: ClassVar[str]
    period_s: ClassVar[float] = 0.01
    is_about_motion: ClassVar[bool] = True

    # --- Cases that a subclass defines

    def safe(self) -> tuple[CommandedMotion, CheckContext]:
        """Returns a safe motion and its context."""
        raise NotImplementedError

    def unsafe(self) -> tuple[CommandedMotion, CheckContext]:
        """Returns an unsafe motion and its context."""
        raise NotImplementedError

    # --- Helpers for a subclass

    def motion(self, start: State, command: Any) -> CommandedMotion:
        """Returns a motion that consists of a command without the braking that would follow."""
        return CommandedMotion(self.robot, start, np.array(command, dtype=float), self.period_s)

    @property
    def robot(self) -> RobotModel:
        """A new model of the robot."""
        return RobotModel(self.urdf)

    def make(self) -> Check:
        """Returns a new instance of the check."""
        robot = self.robot
        limits = MotionLimits.of(robot, LimitsConfig(**self.limits), "guard.yaml")
        options = {self.check_name: {**self.options, "active": True}}
        return next(each for each in make_checks(options, robot, limits, "guard.yaml") if self._is_it(each))

    def _is_it(self, check: Check) -> bool:
        return check.name == self.check_name or self.check_name.endswith(f":{type(check).__name__}")

    # --- The tests.

    def test_safe_motion_passes(self) -> None:
        """A check that refuses every motion fails this test."""
        assert self.make().check(*self.safe()) is None

    def test_unsafe_motion_is_refused_with_value_and_limit(self) -> None:
        """A check that accepts every motion fails this test."""
        check = self.make()
        violation = check.check(*self.unsafe())
        assert violation is not None
        assert violation.check == check.name and violation.subject and violation.unit
        assert violation.value != violation.limit
        assert f"{violation.limit:.6g}" in str(violation)

    def test_equal_motions_have_equal_answers_in_any_order(self) -> None:
        """The answer depends neither on earlier calls nor on the instance of the check."""
        check, other = self.make(), self.make()
        answers = [check.check(*each()) for each in (self.unsafe, self.safe, self.unsafe, self.unsafe, self.safe)]
        assert answers == [answers[0], None, answers[0], answers[0], None]
        assert other.check(*self.safe()) is None
        assert other.check(*self.unsafe()) == answers[0]

    def test_non_finite_target_is_refused(self) -> None:
        """Comparisons with NaN are false, so a check that only refuses too large values would accept NaN."""
        if not self.is_about_motion:
            pytest.skip(f"'{self.check_name}' does not check the motion")
        motion, context = self.safe()
        nowhere = self.motion(motion.start, [math.nan] * len(motion.start.position))
        assert self.make().check(nowhere, context) is not None

    def test_an_unknown_option_is_named(self) -> None:
        """An unknown option raises an error: otherwise, a misspelt option would silently remove a limit."""
        robot = self.robot
        limits = MotionLimits.of(robot, LimitsConfig(), "guard.yaml")
        with pytest.raises(ConfigError, match=f"guard.yaml: checks.{self.check_name}.no_such_option"):
            make_checks({self.check_name: {"no_such_option": 1}}, robot, limits, "guard.yaml")
