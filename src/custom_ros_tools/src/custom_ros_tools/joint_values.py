"""Checked joint values with joint names, as in a joint state, and conversions of joint names and units."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from .errors import InterfaceError

QUANTITIES = ("position", "velocity", "effort")


class MissingJointsError(InterfaceError):
    """A joint state lacks requested joints.

    Attributes:
        names: The missing joints.
        known: The joints in the joint state.
    """

    def __init__(self, names: Sequence[str], known: Sequence[str]) -> None:
        self.names, self.known = tuple(names), tuple(known)
        super().__init__(self.names, self.known)

    def __str__(self) -> str:
        missing = ", ".join(f"'{name}'" for name in self.names)
        has = f"it has {', '.join(self.known)}" if self.known else "it names none"
        return f"no values for joint{'s' if len(self.names) > 1 else ''} {missing}: {has}"


@dataclass(frozen=True)
class JointValues:
    """Positions, velocities and efforts of n joints. Make objects with `of`, which checks the values.

    Attributes:
        names: n joint names; empty if the sender gave no names.
        position: n positions [rad or m]; empty if not given.
        velocity: n velocities [rad/s or m/s]; empty if not given.
        effort: n torques or forces [N m or N]; empty if not given.
    """

    names: tuple[str, ...]
    position: tuple[float, ...] = ()
    velocity: tuple[float, ...] = ()
    effort: tuple[float, ...] = ()

    @classmethod
    def of(
        cls,
        names: Iterable[str],
        position: Iterable[float] | None = None,
        velocity: Iterable[float] | None = None,
        effort: Iterable[float] | None = None,
    ) -> JointValues:
        """Checks values, and returns them as `JointValues`. None means that a quantity is not given.

        Raises:
            ValueError: If lists differ in length, a joint name is repeated, or a value is not finite.
        """
        joints = tuple(names)
        if len(set(joints)) != len(joints):
            raise ValueError(f"joints must be named once each, got {', '.join(joints)}")
        given = (position, velocity, effort)
        values = [() if each is None else tuple(map(float, each)) for each in given]
        count = len(joints) or max(map(len, values))
        for quantity, numbers in zip(QUANTITIES, values):
            if len(numbers) not in (0, count):
                raise ValueError(f"expected {count} values of {quantity}, one a joint, got {len(numbers)}")
            if not all(map(math.isfinite, numbers)):
                raise ValueError(f"values must be finite, got {quantity} {', '.join(f'{v:g}' for v in numbers)}")
        return cls(joints, *values)

    def in_order(self, names: Sequence[str], ns: str = "") -> JointValues:
        """Selects the values of joints in a given order; quantities that are not given stay empty.

        Args:
            names: Names of the joints in the result.
            ns: Prefix of the names in this object: joint `a` is called `ns/a`. By default, names have no prefix.

        Raises:
            MissingJointsError: If joints are missing; the error names all missing joints.
        """
        prefix = f"{ns.rstrip('/')}/" if ns else ""
        index = {name: i for i, name in enumerate(self.names)}
        missing = [prefix + name for name in names if prefix + name not in index]
        if missing:
            raise MissingJointsError(missing, self.names)
        picked = [index[prefix + name] for name in names]
        quantities = (self.position, self.velocity, self.effort)
        return JointValues(tuple(names), *(tuple(v[i] for i in picked) if v else () for v in quantities))

    def converted(self, conversions: Sequence[JointConversion]) -> JointValues:
        """Converts names and values of some joints, and returns all joints in unchanged order.

        Raises:
            MissingJointsError: If joints to convert are missing; the error names all missing joints.
            ValueError: If two joints get the same name, or a converted value is not finite.
        """
        if not conversions:
            return self
        by_joint = {each.joint: each for each in conversions}
        missing = [joint for joint in by_joint if joint not in self.names]
        if missing:
            raise MissingJointsError(missing, self.names)
        each = [by_joint.get(name, JointConversion(name, name)) for name in self.names]
        return JointValues.of(
            (one.name for one in each),
            [one.sign * one.factor * value + one.offset for one, value in zip(each, self.position)],
            [one.sign * one.factor * value for one, value in zip(each, self.velocity)],
            [one.sign * value for one, value in zip(each, self.effort)],
        )


@dataclass(frozen=True)
class JointConversion:
    """Conversion of a joint's name and values from a source system to a target system, such as simulator and driver.

    A position q becomes `sign * factor * q + offset`. A velocity v becomes `sign * factor * v`. An effort e becomes
    `sign * e`.

    Attributes:
        joint: Name of the joint in the source system.
        name: Name of the joint in the target system.
        sign: -1 if the positive directions of the two systems are opposite, otherwise 1.
        factor: Number of target units per source unit.
        offset: Position in the target system at the source position 0 [target units].
    """

    joint: str
    name: str
    sign: int = 1
    factor: float = 1.0
    offset: float = 0.0

    def inverse(self) -> JointConversion:
        """Returns the conversion from the target system to the source system."""
        offset = -self.offset * self.sign / self.factor
        return replace(self, joint=self.name, name=self.joint, factor=1.0 / self.factor, offset=offset)
