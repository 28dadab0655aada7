"""Parses the XML of a URDF, reads joints from XML elements, and makes XML elements."""

import math
import re
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element as Element  # re-exported for other modules
from xml.parsers import expat

from robot_model.geometry import Vector

MOVING = ("revolute", "continuous", "prismatic")
"""Joint types with one axis. Kinematics treat all other types as not moving."""
READ = frozenset(
    "robot material color texture specular link inertial mass inertia origin visual collision geometry box sphere "
    "cylinder capsule mesh plane contact inertia_scaling lateral_friction rolling_friction restitution "
    "spinning_friction friction_anchor stiffness damping joint parent child axis limit dynamics deformable "
    "reduced_deformable collision_margin friction repulsion_stiffness gravity_factor neohookean corotated spring "
    "num_modes stiffness_scale damping_coefficient cache_barycenter".split()
)
"""Tags of the elements that PyBullet reads. Other elements are not passed to PyBullet."""
MAX_TAGS = 50_000
"""Largest number of tags in a file; files with more tags are rejected as not well-formed."""
MAX_NESTED = 100
"""Largest nesting depth of elements; files with deeper nesting are rejected as not well-formed."""
_NOT_XML = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML 1.0 does not allow (https://www.w3.org/TR/xml/#charsets), but PyBullet accepts."""
_ROBOT, _END_OF_ROBOT = re.compile(r"<robot\b"), re.compile(r"</robot\s*>")
_DEFAULT = re.compile(r"\$\(optenv \w+ ([^()]*)\)")
"""Xacro expression for an environment variable with a default value."""
_CHUNK = 1 << 16
"""Number of characters per call of the parser. Between two calls, other threads can run."""
_ZERO: Vector = (0.0, 0.0, 0.0)


class Mimic(NamedTuple):
    """Relation of a mimic joint to the joint called `joint`, which the mimic joint follows.

    Position of the mimic joint = `multiplier` * position of the followed joint + `offset`.
    """

    joint: str
    multiplier: float
    offset: float


class UrdfJoint(NamedTuple):
    """A joint as a URDF describes it.

    Attributes:
        name: Name of the joint.
        type: Type of the joint, such as `revolute`.
        parent: Name of the parent link.
        child: Name of the child link, which the joint moves.
        xyz: Position of the joint's frame in the parent link [m].
        rpy: Orientation of the joint's frame in the parent link: rotations about the parent's fixed axes x, y and z, in
            this order [rad].
        axis: Joint axis as a unit vector in the joint's frame.
        lower: Lower limit [rad or m]; -inf for a joint without limits.
        upper: Upper limit [rad or m]; inf for a joint without limits.
        max_velocity: Largest speed [rad/s or m/s]; inf for a joint without a speed limit.
        mimic: Relation to the followed joint, for a mimic joint; otherwise None.
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
        """Whether the joint is revolute, continuous or prismatic."""
        return self.type in MOVING

    @property
    def is_revolute(self) -> bool:
        """Whether a moving joint turns about its axis: true for revolute and continuous, false for prismatic joints."""
        return self.type != "prismatic"

    @property
    def rest(self) -> float:
        """The position within the joint's limits that is nearest to 0 [rad or m]."""
        return min(max(0.0, self.lower), self.upper)


def parse(text: str) -> Element:
    """Finds the robot element in a text in the same way as PyBullet, and parses it.

    The computing time is proportional to the length of the text.

    Raises:
        ExpatError: If the text is not well-formed.
        RecursionError: If elements are nested too deeply, or the text has too many tags.
    """
    text = _without_comments(text)
    if (tags := text.count("<")) > MAX_TAGS:
        raise RecursionError(f"expected at most {MAX_TAGS} tags, got {tags}")
    start, end = _ROBOT.search(text), _end_of_robot(text)
    if start and start.start() < end:
        text = _blank(text[: start.start()]) + text[start.start() : end]
    # Namespaces are not processed: PyBullet does not support them, and many files use prefixes without declaring them.
    builder, parser = ElementTree.TreeBuilder(), expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    for index in range(0, len(text), _CHUNK):
        parser.Parse(_NOT_XML.sub("", text[index : index + _CHUNK]), False)
    parser.Parse("", True)
    robot = builder.close()
    _check_depth(robot)
    if "$(optenv" in text:  # a robot in PyBullet's data contains unexpanded xacro
        for element in robot.iter():
            element.attrib.update({key: _DEFAULT.sub(r"\1", value) for key, value in element.attrib.items()})
    return robot


def _without_comments(text: str) -> str:
    """Replaces comments by spaces, also comments with `--`, which PyBullet allows but XML does not."""
    parts, end = [], 0
    while (start := text.find("<!--", end)) >= 0 and (stop := text.find("-->", start + 4)) >= 0:
        parts += [text[end:start], _blank(text[start : stop + 3])]
        end = stop + 3
    return "".join((*parts, text[end:]))


def _end_of_robot(text: str) -> int:
    """Returns the index after the last `</robot>` tag, or 0 without such a tag."""
    start = len(text)
    while (start := text.rfind("</robot", 0, start)) >= 0:
        if match := _END_OF_ROBOT.match(text, start):
            return match.end()
    return 0


def _blank(text: str) -> str:
    """Replaces all characters but newlines by spaces. This keeps lines and columns in the parser's messages right."""
    return "\n".join(" " * len(line) for line in text.split("\n"))


def _check_depth(root: Element) -> None:
    level = [root]
    for _ in range(MAX_NESTED):
        level = [child for element in level for child in element]
    if level:
        raise RecursionError(f"expected elements in at most {MAX_NESTED} others")


def as_read(element: Element) -> Element:
    """Copies an element with its attributes and nested elements, without text and elements that PyBullet ignores."""
    result = Element(element.tag, element.attrib)
    result.extend([as_read(child) for child in element if child.tag in READ])
    return result


def read_joint(element: Element) -> UrdfJoint:
    """Reads a joint element.

    As in PyBullet, a joint whose lower limit is not below its upper limit has no limits.

    Raises:
        ValueError: If a value is invalid; the message names the joint.
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
    """Reads the mimic relation of a joint element; returns None for a joint that is not a mimic joint.

    Raises:
        ValueError: If a value is invalid; the message names the joint.
    """
    if element.find("mimic") is None:
        return None
    multiplier = _number(element, "mimic", "multiplier", "1")
    if multiplier == 0.0:
        raise ValueError(f"joint '{element.get('name', '')}': mimic.multiplier: must not be 0")
    return Mimic(_attribute(element, "mimic", "joint"), multiplier, _number(element, "mimic", "offset", "0"))


def end_of(joint: Element, end: str) -> str:
    """Returns the name of a joint element's parent link (`end="parent"`) or child link (`end="child"`)."""
    return _attribute(joint, end, "link")


def read_vector(joint: Element, part: str, key: str, default: str) -> Vector:
    """Reads three numbers from an XML attribute of an element inside a joint, link or shape element.

    Args:
        joint: The outer element.
        part: Tag of the inner element, such as `origin`.
        key: Name of the attribute, such as `xyz`.
        default: Text to read if the inner element or the attribute is missing.

    Raises:
        ValueError: If the text is not three finite numbers; the message names the outer element.
    """
    x, y, z = _numbers(joint, part, key, default)
    return x, y, z


def _number(joint: Element, part: str, key: str, default: str) -> float:
    return _numbers(joint, part, key, default)[0]


def _numbers(joint: Element, part: str, key: str, default: str) -> list[float]:
    """Reads finite numbers from an attribute, as many as the default text contains; see `read_vector`."""
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
    """Makes a joint element that contains only the parts needed for kinematics."""
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
    """Makes an inertial element with the centre of mass at the link's origin.

    Args:
        mass: The mass [kg]. The same number is the moment of inertia about each axis [kg m^2].
    """
    inertia = {"ixx": mass, "iyy": mass, "izz": mass, "ixy": "0", "ixz": "0", "iyz": "0"}
    return new_element("inertial", new_element("mass", value=mass), new_element("inertia", **inertia))


def new_element(tag: str, /, *parts: Element, **attributes: str) -> Element:
    """Makes an element with child elements (`parts`) and attributes."""
    element = Element(tag, attributes)
    element.extend(parts)
    return element


def words(vector: Vector) -> str:
    """Formats three numbers as an attribute's text, without loss of precision."""
    return " ".join(map(repr, vector))


def text_of(element: Element) -> str:
    """Formats an element as text with one tag per line, since PyBullet cannot read very long lines."""
    return ElementTree.tostring(element, encoding="unicode").replace("><", ">\n<")
