"""Position, velocity or effort commands to some joints of a robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from custom_ros_tools.joint_values import QUANTITIES
from custom_ros_tools.schema.type_names import shown
from rpbi.plain_values import joint_values


class WrongQuantityError(ValueError):
    """A command lacks the quantity that the robot needs: position, velocity or effort."""


class JointCommand(NamedTuple):
    """Commands to n joints of a robot; joints that are not named keep their present targets.

    A command is not validated when it is created. The robot that receives the command checks the values.

    Attributes:
        names: n joint names.
        position: n positions [rad or m], or empty.
        velocity: n velocities [rad/s or m/s], or empty.
        effort: n torques or forces [N m or N], or empty.
        stamp_ns: Time [ns] of sending by the sender's clock; 0 if unknown.
    """

    names: Sequence[str]
    position: Sequence[float] = ()
    velocity: Sequence[float] = ()
    effort: Sequence[float] = ()
    stamp_ns: int = 0

    @classmethod
    def of(cls, given: JointCommand | Mapping[str, float], quantity: str) -> JointCommand:
        """Creates a command from a mapping; returns a command unchanged.

        Args:
            given: A mapping from joint names to numbers, or a command.
            quantity: Quantity of the mapping's numbers: `position`, `velocity` or `effort`.

        Raises:
            ValueError: If `given` is neither a command nor a mapping from joint names to numbers.
        """
        if isinstance(given, cls):
            return given
        if not isinstance(given, Mapping):
            raise ValueError(f"expected a JointCommand or a mapping of joints to numbers, got {shown(given)}")
        values = joint_values(given)
        given_values: dict[str, Any] = {quantity: tuple(values.values())}
        return cls(tuple(values), **given_values)

    def values_of(self, quantity: str, reason: str) -> Sequence[float]:
        """Returns the values of one quantity, and refuses a command without these values.

        Args:
            quantity: `position`, `velocity` or `effort`.
            reason: Reason why the quantity is needed, for the error message.

        Raises:
            WrongQuantityError: If the command names joints, but has no values of the quantity.
        """
        values: Sequence[float] = getattr(self, quantity)
        if not values and self.names:
            given = " and ".join(each for each in QUANTITIES if getattr(self, each)) or "no values"
            raise WrongQuantityError(f"expected {quantity}, since {reason}; got {given}")
        return values
