"""Errors about demonstrations and plans."""

from dataclasses import dataclass

from custom_ros_tools.errors import InterfaceError


@dataclass(eq=False)
class _UnexpectedInput(InterfaceError):  # noqa: N818 (base of the two below)
    """Base class of the errors about invalid input.

    Attributes:
        subject: Name of the invalid argument or part.
        expected: Description of valid input.
        got: Description of the given input.
    """

    subject: str
    expected: str
    got: str

    def __str__(self) -> str:
        return f"{self.subject}: expected {self.expected}, got {self.got}"


class DemonstrationError(_UnexpectedInput):
    """A primitive cannot learn from a demonstration, or from a set of demonstrations.

    The attribute `subject` is `times`, `positions`, `orientations` or `demonstrations`.
    """


class PlanError(_UnexpectedInput):
    """A motion cannot be planned as requested. `subject` is the argument that does not fit the primitive."""


@dataclass(eq=False)
class GoalNotReachedError(InterfaceError):
    """A planned motion does not end at its goal.

    Attributes:
        distance: Largest difference of a position from the goal [m or rad].
        angle_rad: Angle between the orientation and the goal's orientation [rad].
        duration_s: Duration of the motion when planning stopped [s].
        tolerance: Largest `distance` at which the goal counts as reached [m or rad].
        tolerance_rad: Largest `angle_rad` at which the goal counts as reached [rad].
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
