"""Values of joints by name, as in a joint state."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from .errors import InterfaceError

QUANTITIES = ("position", "velocity", "effort")


class MissingJointsError(InterfaceError):
    """A joint state lacks requested joints; `known` are those that it has."""

    def __init__(self, names: Sequence[str], known: Sequence[str]) -> None:
        self.names, self.known = tuple(names), tuple(known)
        super().__init__(self.names, self.known)

    def __str__(self) -> str:
        missing = ", ".join(f"'{name}'" for name in self.names)
        has = f"it has {', '.join(self.known)}" if self.known else "it names none"
        return f"no values for joint{'s' if len(self.names) > 1 else ''} {missing}: {has}"


@dataclass(frozen=True)
class JointValues:
    """Checked values of joints, which are measured, remapped or guarded; made by `of`.

    Attributes:
        names: n joint names; empty if the sender names none.
        position: n positions [rad or m], or none.
        velocity: n velocities [rad/s or m/s], or none.
        effort: n torques or forces [N m or N], or none.
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
        """Returns checked values; None means that the quantity is not given.

        Raises:
            ValueError: If lengths differ, a joint is named twice or a value is not finite.
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
        """Returns the values of some joints in the requested order; a quantity that is missing stays empty.

        Args:
            names: The joints, under which the result lists them.
            ns: Prefix of their names here, as `ns` in `ns/joint`; empty for none.

        Raises:
            MissingJointsError: If joints are missing; it names all of them.
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
        """Returns the values with some joints converted, in the same order; others stay as they are.

        Raises:
            MissingJointsError: If a joint to convert is missing; it names all of them.
            ValueError: If a joint gets the name of another, or a value is no longer finite.
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
    """Conversion of the values of a joint to other names and units.

    A position q becomes `sign * factor * q + offset`, a velocity v `sign * factor * v`, an effort e `sign * e`.

    Attributes:
        joint: Its name here.
        name: Its name there.
        sign: 1, or -1 if the joint rotates the other way there.
        factor: Number of their units per unit here.
        offset: Their position [their unit] at position 0 here.
    """

    joint: str
    name: str
    sign: int = 1
    factor: float = 1.0
    offset: float = 0.0

    def inverse(self) -> JointConversion:
        """Returns the inverse conversion."""
        offset = -self.offset * self.sign / self.factor
        return replace(self, joint=self.name, name=self.joint, factor=1.0 / self.factor, offset=offset)
