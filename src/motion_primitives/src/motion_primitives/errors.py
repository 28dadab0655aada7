"""Errors of demonstrations and of plans."""

from dataclasses import dataclass

from custom_ros_tools.errors import InterfaceError


@dataclass(eq=False)
class _UnexpectedInput(InterfaceError):  # noqa: N818 (base of the two below)
    """Invalid input.

    Attributes:
        subject: The part that is wrong.
        expected: Description of what is needed.
        got: Description of what was given.
    """

    subject: str
    expected: str
    got: str

    def __str__(self) -> str:
        return f"{self.subject}: expected {self.expected}, got {self.got}"


class DemonstrationError(_UnexpectedInput):
    """A demonstration, or a set of them, cannot be learned from.

    The subject is `times`, `positions`, `orientations` or `demonstrations`.
    """


class PlanError(_UnexpectedInput):
    """A motion cannot be planned as requested: the subject is an argument that does not fit the primitive."""


@dataclass(eq=False)
class GoalNotReachedError(InterfaceError):
    """A planned motion does not end at its goal.

    Attributes:
        distance: Largest distance of a position from its goal [m or rad].
        angle_rad: Angle between the orientation and its goal [rad].
        duration_s: Duration after which planning was given up [s].
        tolerance: Largest distance that counts as reached [m or rad].
        tolerance_rad: Largest angle that counts as reached [rad].
    """

    distance: float
    angle_rad: float
    duration_s: float
    tolerance: float
    tolerance_rad: float

    def __str__(self) -> str:
        return (
            f"goal: missed by {self.distance:.3g} m (or rad, for joints) and {self.angle_rad:.3g} rad after "
            f"{self.duration_s:.3g} s, expected at most {self.tolerance:.3g} and {self.tolerance_rad:.3g} rad"
        )


class NotLearnedError(InterfaceError):
    """A primitive was used before `learn`."""

    def __str__(self) -> str:
        return "the primitive has learned nothing yet: expected demonstrations first"
