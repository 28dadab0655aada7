"""The XML of a URDF: what its elements say as plain data, and elements that are made of it."""

import math
import re
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element as Element  # other modules have it from here
from xml.parsers import expat

from rpbi.geometry import Vector

from .files import COMMENT, NOT_XML

MOVING = ("revolute", "continuous", "prismatic")
"""Types of joints with one axis, which kinematics are solved for."""
_ROBOT = re.compile(r"<robot\b.*</robot\s*>", re.DOTALL)
_ZERO: Vector = (0.0, 0.0, 0.0)


class Mimic(NamedTuple):
    """That a joint follows another: its position is `multiplier` times that of the other, plus `offset`."""

    joint: str
    multiplier: float
    offset: float


class UrdfJoint(NamedTuple):
    """A joint as a URDF describes it.

    Attributes:
        name: Its name.
        type: Its type, such as `revolute`.
        parent: The link it is fixed to.
        child: The link that it moves.
        xyz: Its position in the parent link [m].
        rpy: Its rotation there, about the parent's x, y and z one after the other [rad].
        axis: Unit vector, in the joint's frame.
        lower: Lower limit [rad or m], -inf if there is none.
        upper: Upper limit [rad or m], inf if there is none.
        max_velocity: Largest speed [rad/s or m/s], inf if there is none.
        mimic: The joint that it follows, if any.
    """

    name: str
    type: str
    parent: str
    child: str
    xyz: Vector = _ZERO
    rpy: Vector = _ZERO
    axis: Vector = (1.0, 0.0, 0.0)
    lower: float = -math.inf
    upper: float = math.inf
    max_velocity: float = math.inf
    mimic: Mimic | None = None

    @property
    def is_moving(self) -> bool:
        """Whether it has one axis to move about or along."""
        return self.type in MOVING

    @property
    def is_revolute(self) -> bool:
        """Whether it turns about its axis."""
        return self.type != "prismatic"


def parse(text: str) -> Element:
    """Returns the robot that stands in a text, as PyBullet finds it.

    Raises:
        ExpatError: If it is not well-formed.
        RecursionError: If it is nested too deeply.
    """
    text = COMMENT.sub(lambda comment: _blank(comment[0]), NOT_XML.sub("", text))
    robot = _ROBOT.search(text)
    # Without namespaces: PyBullet knows none, and many files have prefixes that they do not declare.
    builder, parser = ElementTree.TreeBuilder(), expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    parser.Parse(_blank(text[: robot.start()]) + robot[0] if robot else text, True)
    return builder.close()


def _blank(text: str) -> str:
    """Returns as many spaces, so that messages of the parser have the file's lines and columns."""
    return re.sub(r"\S", " ", text)


def read_joint(element: Element) -> UrdfJoint:
    """Reads a joint; as in PyBullet, lower limits that are not below the upper ones mean that there are none.

    Raises:
        ValueError: If a value makes no sense; it names the joint.
    """
    name, kind = element.get("name", ""), element.get("type", "")
    lower, upper, speed = (_number(element, "limit", key, "0") for key in ("lower", "upper", "velocity"))
    if kind == "continuous" or not lower < upper:
        lower, upper = -math.inf, math.inf
    x, y, z = read_vector(element, "axis", "xyz", "1 0 0")
    length = math.hypot(x, y, z)
    if kind in MOVING and length < 1e-6:
        raise ValueError(f"joint '{name}': axis: must not be zero")
    return UrdfJoint(
        name=name,
        type=kind,
        parent=end_of(element, "parent"),
        child=end_of(element, "child"),
        xyz=read_vector(element, "origin", "xyz", "0 0 0"),
        rpy=read_vector(element, "origin", "rpy", "0 0 0"),
        axis=(x / length, y / length, z / length) if length else (1.0, 0.0, 0.0),
        lower=lower,
        upper=upper,
        max_velocity=speed if speed > 0.0 else math.inf,
        mimic=read_mimic(element),
    )


def read_mimic(element: Element) -> Mimic | None:
    """Returns what a joint follows, if anything.

    Raises:
        ValueError: If a value makes no sense; it names the joint.
    """
    if element.find("mimic") is None:
        return None
    multiplier = _number(element, "mimic", "multiplier", "1")
    if multiplier == 0.0:
        raise ValueError(f"joint '{element.get('name', '')}': mimic.multiplier: must not be 0")
    return Mimic(_attribute(element, "mimic", "joint"), multiplier, _number(element, "mimic", "offset", "0"))


def end_of(joint: Element, end: str) -> str:
    """Returns the link at an end of a joint, `parent` or `child`."""
    return _attribute(joint, end, "link")


def read_vector(joint: Element, part: str, key: str, default: str) -> Vector:
    """Returns the three numbers of an attribute of a joint's part, the default if there is none.

    Raises:
        ValueError: If they are not three finite numbers; it names the joint.
    """
    x, y, z = _numbers(joint, part, key, default)
    return x, y, z


def _number(joint: Element, part: str, key: str, default: str) -> float:
    return _numbers(joint, part, key, default)[0]


def _numbers(joint: Element, part: str, key: str, default: str) -> list[float]:
    """Returns the finite numbers of an attribute, as many as the default has."""
    text, count = _attribute(joint, part, key, default), len(default.split())
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != count or not all(map(math.isfinite, values)):
        numbers = "a finite number" if count == 1 else f"{count} finite numbers"
        raise ValueError(f"joint '{joint.get('name', '')}': {part}.{key}: expected {numbers}, got '{text}'")
    return values


def _attribute(element: Element, part: str, key: str, default: str = "") -> str:
    found = element.find(part)
    return default if found is None else found.get(key, default)


def joint_element(joint: UrdfJoint) -> Element:
    """Returns a joint with what counts for positions."""
    unlimited = joint.lower == -math.inf
    parts = [new_element("parent", link=joint.parent), new_element("child", link=joint.child)]
    parts.append(new_element("origin", xyz=words(joint.xyz), rpy=words(joint.rpy)))
    if joint.is_moving:
        lower, upper = (1.0, -1.0) if unlimited else (joint.lower, joint.upper)
        parts.append(new_element("axis", xyz=words(joint.axis)))
        parts.append(new_element("limit", lower=repr(lower), upper=repr(upper), effort="0", velocity="0"))
    kind = "continuous" if unlimited and joint.type == "revolute" else joint.type
    return new_element("joint", *parts, name=joint.name, type=kind)


def inertial(mass: str) -> Element:
    """Returns a mass [kg], and as much inertia about each axis [kg m^2], at the link's frame."""
    inertia = {"ixx": mass, "iyy": mass, "izz": mass, "ixy": "0", "ixz": "0", "iyz": "0"}
    return new_element("inertial", new_element("mass", value=mass), new_element("inertia", **inertia))


def new_element(tag: str, /, *parts: Element, **attributes: str) -> Element:
    """Returns an element with parts and attributes."""
    element = Element(tag, attributes)
    element.extend(parts)
    return element


def words(vector: Vector) -> str:
    """Returns numbers as an attribute has them, to the last bit."""
    return " ".join(map(repr, vector))


def text_of(element: Element) -> str:
    """Returns the text of an element, with a line for each tag: PyBullet cannot read very long lines."""
    return ElementTree.tostring(element, encoding="unicode").replace("><", ">\n<")
