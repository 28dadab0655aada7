"""The XML of a URDF: elements as plain data, and plain data as elements."""

import math
import re
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element as Element  # re-exported for other modules
from xml.parsers import expat

from robot_model.geometry import Vector

MOVING = ("revolute", "continuous", "prismatic")
"""Types of joints with one axis, which kinematics are solved for."""
READ = frozenset(
    "robot material color texture specular link inertial mass inertia origin visual collision geometry box sphere "
    "cylinder capsule mesh plane contact inertia_scaling lateral_friction rolling_friction restitution "
    "spinning_friction friction_anchor stiffness damping joint parent child axis limit dynamics deformable "
    "reduced_deformable collision_margin friction repulsion_stiffness gravity_factor neohookean corotated spring "
    "num_modes stiffness_scale damping_coefficient cache_barycenter".split()
)
"""Elements that PyBullet reads; only these are passed on."""
MAX_TAGS = 50_000
"""Largest number of tags in a file; a file with more is rejected as not well-formed."""
MAX_NESTED = 100
"""Largest depth of elements; a deeper file is rejected as not well-formed."""
_NOT_XML = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML 1.0 does not allow (https://www.w3.org/TR/xml/#charsets); PyBullet accepts them."""
_ROBOT, _END_OF_ROBOT = re.compile(r"<robot\b"), re.compile(r"</robot\s*>")
_DEFAULT = re.compile(r"\$\(optenv \w+ ([^()]*)\)")
"""Reference to an environment variable in xacro, with its default."""
_CHUNK = 1 << 16
"""Number of characters that are parsed at once; other threads run in between."""
_ZERO: Vector = (0.0, 0.0, 0.0)


class Mimic(NamedTuple):
    """Relation of a mimic joint to the joint that it follows: its position is `multiplier` times that of the other,
    plus `offset`."""

    joint: str
    multiplier: float
    offset: float


class UrdfJoint(NamedTuple):
    """A joint as a URDF describes it.

    Attributes:
        name: Its name.
        type: Its type, such as `revolute`.
        parent: The link that it is attached to.
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
        """Whether it moves about or along one axis."""
        return self.type in MOVING

    @property
    def is_revolute(self) -> bool:
        """Whether it turns about its axis."""
        return self.type != "prismatic"

    @property
    def rest(self) -> float:
        """The position within its limits that is nearest to 0 [rad or m]."""
        return min(max(0.0, self.lower), self.upper)


def parse(text: str) -> Element:
    """Returns the robot element in a text, found as PyBullet does, in time linear in its length.

    Raises:
        ExpatError: If it is not well-formed.
        RecursionError: If it is nested too deeply, or has too many elements.
    """
    text = _without_comments(text)
    if (tags := text.count("<")) > MAX_TAGS:
        raise RecursionError(f"expected at most {MAX_TAGS} tags, got {tags}")
    start, end = _ROBOT.search(text), _end_of_robot(text)
    if start and start.start() < end:
        text = _blank(text[: start.start()]) + text[start.start() : end]
    # Without namespaces: PyBullet knows none, and many files have prefixes that they do not declare.
    builder, parser = ElementTree.TreeBuilder(), expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    for index in range(0, len(text), _CHUNK):
        parser.Parse(_NOT_XML.sub("", text[index : index + _CHUNK]), False)
    parser.Parse("", True)
    robot = builder.close()
    _check_depth(robot)
    if "$(optenv" in text:  # xacro left unexpanded in a robot of PyBullet's data
        for element in robot.iter():
            element.attrib.update({key: _DEFAULT.sub(r"\1", value) for key, value in element.attrib.items()})
    return robot


def _without_comments(text: str) -> str:
    """Returns a text with comments replaced by spaces; unlike XML, PyBullet allows `--` in comments."""
    parts, end = [], 0
    while (start := text.find("<!--", end)) >= 0 and (stop := text.find("-->", start + 4)) >= 0:
        parts += [text[end:start], _blank(text[start : stop + 3])]
        end = stop + 3
    return "".join((*parts, text[end:]))


def _end_of_robot(text: str) -> int:
    """Returns the index of the end of the last robot element, 0 if there is none."""
    start = len(text)
    while (start := text.rfind("</robot", 0, start)) >= 0:
        if match := _END_OF_ROBOT.match(text, start):
            return match.end()
    return 0


def _blank(text: str) -> str:
    """Replaces a match by spaces, so that lines and columns in the parser's messages are those of the file."""
    return "\n".join(" " * len(line) for line in text.split("\n"))


def _check_depth(root: Element) -> None:
    level = [root]
    for _ in range(MAX_NESTED):
        level = [child for element in level for child in element]
    if level:
        raise RecursionError(f"expected elements in at most {MAX_NESTED} others")


def as_read(element: Element) -> Element:
    """Returns a copy of an element with only the parts that PyBullet reads: known elements and attributes, no text."""
    result = Element(element.tag, element.attrib)
    result.extend([as_read(child) for child in element if child.tag in READ])
    return result


def read_joint(element: Element) -> UrdfJoint:
    """Reads a joint; as in PyBullet, a lower limit that is not below the upper one means no limits.

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
    """Returns the mimic relation of a joint, None if it has none.

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
    """Returns the element of a joint with only the parts that kinematics need."""
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
    """Returns an inertial element at the link's frame, with a mass [kg] and the same number as inertia about each axis
    [kg m^2]."""
    inertia = {"ixx": mass, "iyy": mass, "izz": mass, "ixy": "0", "ixz": "0", "iyz": "0"}
    return new_element("inertial", new_element("mass", value=mass), new_element("inertia", **inertia))


def new_element(tag: str, /, *parts: Element, **attributes: str) -> Element:
    """Returns an element with children and attributes."""
    element = Element(tag, attributes)
    element.extend(parts)
    return element


def words(vector: Vector) -> str:
    """Returns numbers as the text of an attribute, exact to the last bit."""
    return " ".join(map(repr, vector))


def text_of(element: Element) -> str:
    """Returns the text of an element, with a line for each tag: PyBullet cannot read very long lines."""
    return ElementTree.tostring(element, encoding="unicode").replace("><", ">\n<")
