"""Commands to some joints of a robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from custom_ros_tools.joint_values import QUANTITIES
from custom_ros_tools.schema.type_names import shown
from rpbi.plain_values import joint_values


class WrongQuantityError(ValueError):
    """A command lacks the required quantity."""


class JointCommand(NamedTuple):
    """Values for some of a robot's joints; the others keep theirs.

    An input of the world, which the robot checks against its own joints; `JointValues` are checked by themselves.

    Attributes:
        names: n joint names.
        position: n positions [rad or m], or none.
        velocity: n velocities [rad/s or m/s], or none.
        effort: n torques or forces [N m or N], or none.
        stamp_ns: Time of sending by the sender's clock [ns], 0 if unknown.
    """

    names: Sequence[str]
    position: Sequence[float] = ()
    velocity: Sequence[float] = ()
    effort: Sequence[float] = ()
    stamp_ns: int = 0

    @classmethod
    def of(cls, given: JointCommand | Mapping[str, float], quantity: str) -> JointCommand:
        """Returns a target; a mapping of joints to numbers is converted to one of that quantity.

        Raises:
            ValueError: If it is neither.
        """
        if isinstance(given, cls):
            return given
        if not isinstance(given, Mapping):
            raise ValueError(f"expected a JointCommand or a mapping of joints to numbers, got {shown(given)}")
        values = joint_values(given)
        given_values: dict[str, Any] = {quantity: tuple(values.values())}
        return cls(tuple(values), **given_values)

    def values_of(self, quantity: str, reason: str) -> Sequence[float]:
        """Returns the values of one quantity.

        Args:
            quantity: `position`, `velocity` or `effort`.
            reason: Why it must be this one, for the message.

        Raises:
            WrongQuantityError: If joints are named and it has none for them.
        """
        values: Sequence[float] = getattr(self, quantity)
        if not values and self.names:
            given = " and ".join(each for each in QUANTITIES if getattr(self, each)) or "no values"
            raise WrongQuantityError(f"expected {quantity}, since {reason}; got {given}")
        return values
