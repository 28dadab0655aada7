"""Joints between two links of a robot, as a URDF describes them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement

Vector = tuple[float, float, float]
MOVING = ("revolute", "continuous", "prismatic")
"""Types of joints that are solved for."""


@dataclass(frozen=True)
class Mimic:
    """That a joint goes along with another: its position is `multiplier` times that of the other, plus `offset`."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class ChainJoint:
    """One joint.

    Attributes:
        name: Its name.
        type: Its type in the URDF, such as `revolute`.
        parent: The link that it hangs on.
        child: The link that it moves.
        xyz: Where it is in the parent link [m].
        rpy: How it is turned there, about the parent's x, y and z one after the other [rad].
        axis: Unit vector, in the joint's frame.
        lower: Lower limit [rad or m], -inf if there is none.
        upper: Upper limit [rad or m], inf if there is none.
        max_velocity: Largest speed [rad/s or m/s], inf if there is none.
        mimic: The joint that it goes along with, if any.
    """

    name: str
    type: str
    parent: str
    child: str
    xyz: Vector
    rpy: Vector
    axis: Vector
    lower: float
    upper: float
    max_velocity: float
    mimic: Mimic | None

    @classmethod
    def from_xml(cls, element: Element) -> ChainJoint:
        """Reads a `joint` of a URDF.

        As in PyBullet, lower limits that are not below the upper ones mean that there are none.

        Raises:
            ValueError: If a value makes no sense; it names the joint.
        """
        name, kind = element.get("name", ""), element.get("type", "")
        lower, upper, speed = (_number(name, element, "limit", key, "0") for key in ("lower", "upper", "velocity"))
        if kind == "continuous" or not lower < upper:
            lower, upper = -math.inf, math.inf
        x, y, z = _vector(name, element, "axis", "xyz", "1 0 0")
        length = math.hypot(x, y, z)
        if kind in MOVING and length < 1e-6:
            raise ValueError(f"joint '{name}': axis: must not be zero")
        axis = (x / length, y / length, z / length) if length else (1.0, 0.0, 0.0)
        return cls(
            name=name,
            type=kind,
            parent=_attribute(element, "parent", "link"),
            child=_attribute(element, "child", "link"),
            xyz=_vector(name, element, "origin", "xyz", "0 0 0"),
            rpy=_vector(name, element, "origin", "rpy", "0 0 0"),
            axis=axis,
            lower=lower,
            upper=upper,
            max_velocity=speed if speed > 0.0 else math.inf,
            mimic=_mimic(name, element),
        )

    def to_xml(self) -> Element:
        """Returns a `joint` of a URDF with what counts for positions."""
        unlimited = self.lower == -math.inf
        kind = "continuous" if unlimited and self.type == "revolute" else self.type
        joint = Element("joint", name=self.name, type=kind)
        SubElement(joint, "parent", link=self.parent)
        SubElement(joint, "child", link=self.child)
        SubElement(joint, "origin", xyz=_text(self.xyz), rpy=_text(self.rpy))
        if self.is_moving:
            lower, upper = (1.0, -1.0) if unlimited else (self.lower, self.upper)
            SubElement(joint, "axis", xyz=_text(self.axis))
            SubElement(joint, "limit", lower=repr(lower), upper=repr(upper), effort="0", velocity="0")
        return joint

    @property
    def is_moving(self) -> bool:
        """Whether it has one axis to move about or along."""
        return self.type in MOVING

    @property
    def is_revolute(self) -> bool:
        """Whether it turns about its axis."""
        return self.type != "prismatic"


def _text(vector: Vector) -> str:
    return " ".join(map(repr, vector))


def _mimic(name: str, element: Element) -> Mimic | None:
    if element.find("mimic") is None:
        return None
    multiplier = _number(name, element, "mimic", "multiplier", "1")
    if multiplier == 0.0:
        raise ValueError(f"joint '{name}': mimic.multiplier: must not be 0")
    return Mimic(_attribute(element, "mimic", "joint"), multiplier, _number(name, element, "mimic", "offset", "0"))


def _attribute(element: Element, part: str, key: str, default: str = "") -> str:
    found = element.find(part)
    return default if found is None else found.get(key, default)


def _number(joint: str, element: Element, part: str, key: str, default: str) -> float:
    return _numbers(joint, element, part, key, default, 1)[0]


def _vector(joint: str, element: Element, part: str, key: str, default: str) -> Vector:
    x, y, z = _numbers(joint, element, part, key, default, 3)
    return x, y, z


def _numbers(joint: str, element: Element, part: str, key: str, default: str, count: int) -> list[float]:
    text = _attribute(element, part, key, default)
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != count or not all(map(math.isfinite, values)):
        numbers = "a finite number" if count == 1 else f"{count} finite numbers"
        raise ValueError(f"joint '{joint}': {part}.{key}: expected {numbers}, got '{text}'")
    return values
