"""The one place where the XML of a URDF is parsed, into plain data, and written."""

import copy
import math
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from xml.parsers import expat

from custom_ros_tools.config import read_file
from custom_ros_tools.errors import ConfigError, Problem, shortened
from rpbi.geometry import Vector, scaled

from .files import COMMENT, NOT_XML, beside_or_above, mesh_file

MOST_BYTES = 64_000_000
"""A file may be so long."""
MOVING = ("revolute", "continuous", "prismatic")
"""Types of joints with one axis, which kinematics are solved for."""
_ROBOT = re.compile(r"<robot\b.*</robot\s*>", re.DOTALL)
_ZERO: Vector = (0.0, 0.0, 0.0)


class Mimic(NamedTuple):
    """That a joint follows another: its position is `multiplier` times that of the other, plus `offset`."""

    joint: str
    multiplier: float
    offset: float


class Edge(NamedTuple):
    """A joint, as far as it ties links."""

    joint: str
    parent: str
    child: str


class Attribute(NamedTuple):
    """A text in a URDF.

    Attributes:
        owner: The link or joint that it is of, for messages.
        tag: The element that has it.
        key: Its name.
        text: What it says.
    """

    owner: str
    tag: str
    key: str
    text: str


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


class UrdfDocument:
    """The links and joints of a URDF file.

    As PyBullet does, it ignores text around the robot and characters that XML does not allow.

    Args:
        path: The file, for messages; the meshes it names need not be there.
        source: The file to read in its place.
        not_xml: What messages say of a file that is not well-formed.

    Attributes:
        tag: The element at the top, `robot` in a URDF.
        links: Names of all links.
        joint_types: Type of each joint by name, such as `revolute` or `fixed`.
        edges: All joints, with the links that they tie, in the file's order.
        meshes: The meshes of links, as the file names them.

    Raises:
        ConfigError: If it cannot be read or is not well-formed.
    """

    def __init__(self, path: str, source: str | None = None, not_xml: str = "is not XML") -> None:
        self.path, self._source = path, Path(source or path)
        try:
            self._root = _parse(read_file(self._source, MOST_BYTES).decode(errors="replace"))
        except OSError as error:
            raise ConfigError([Problem(path, "", (error.strerror or str(error)).lower())]) from None
        except (expat.ExpatError, RecursionError) as error:
            raise ConfigError([Problem(path, "", f"{not_xml}: {error}")]) from None
        self.tag = self._root.tag
        self._joints = self._root.findall("joint")
        self.links = [link.get("name", "") for link in self._root.findall("link")]
        self.joint_types = {joint.get("name", ""): joint.get("type", "") for joint in self._joints}
        self.meshes = list(dict.fromkeys(mesh.get("filename", "") for mesh in self._root.iter("mesh")))
        self.edges = [
            Edge(joint.get("name", ""), _end(joint, "parent"), _end(joint, "child")) for joint in self._joints
        ]

    @cached_property
    def joints(self) -> dict[str, UrdfJoint]:
        """All joints by name.

        Raises:
            ValueError: If a value makes no sense; it names the joint.
        """
        return {joint.name: joint for joint in map(_read_joint, self._joints)}

    @cached_property
    def mimics(self) -> dict[str, Mimic]:
        """What joints follow others, by name.

        Raises:
            ValueError: If a value makes no sense; it names the joint.
        """
        found = {joint.get("name", ""): _mimic(joint) for joint in self._joints}
        return {name: mimic for name, mimic in found.items() if mimic is not None}

    def meshes_of(self, part: str) -> list[str]:
        """Returns the meshes of a part of links, `visual` or `collision`, as the file names them."""
        found = self._root.iterfind(f"link/{part}//mesh")
        return list(dict.fromkeys(mesh.get("filename", "") for mesh in found))

    def attributes(self) -> Iterator[Attribute]:
        """Yields all that stands in its links and joints."""
        for owner in self._root:
            for element in owner.iter():
                for key, text in element.attrib.items():
                    yield Attribute(f"{owner.tag} '{shortened(owner.get('name', ''))}'", element.tag, key, text)

    @property
    def links_without_inertial(self) -> set[str]:
        """Names of the links of which it tells neither mass nor inertia."""
        return {link.get("name", "") for link in self._root.findall("link") if link.find("inertial") is None}

    @property
    def is_soft(self) -> bool:
        """Whether it describes a soft body."""
        return self._root.find("deformable") is not None

    def deformable_meshes(self) -> list[str]:
        """Returns the files that its soft body is made of; none if it describes none.

        Raises:
            ConfigError: If a mesh does not exist.
        """
        names = [part.get("filename") for deformable in self._root.findall("deformable") for part in deformable]
        return [str(mesh_file(name, self._source)) for name in dict.fromkeys(names) if name]

    def joints_above(self, link: str) -> Iterator[tuple[str, str, str]]:
        """Yields name, type and parent link of each joint between a link and the root, from the link upwards."""
        above = {_end(joint, "child"): joint for joint in self._joints}
        while (joint := above.pop(link, None)) is not None:
            link = _end(joint, "parent")
            yield joint.get("name", ""), joint.get("type", ""), link

    def bare(self, links: Sequence[str] | None = None) -> str:
        """Returns a URDF without shapes, of all or some links and the joints between them.

        It loads in half a millisecond where meshes take up to some hundred. Every link has unit mass at its own frame,
        so that PyBullet's frames of mass centres are the links' frames.
        """
        kept = [name for name in self.links if links is None or name in links]
        ends = {*kept}
        joints = [one for one in self._joints if links is None or {_end(one, "parent"), _end(one, "child")} <= ends]
        bare = [_element("link", _inertial("1"), name=name) for name in kept]
        return _text(_element("robot", *bare, *joints, **self._root.attrib))

    def with_limited_joints(self, base: str | None = None) -> str:
        """Returns all of it, with limits from 0 to 0, which mean none, for joints that turn without end.

        So each of them has one number in Pinocchio, which else has two for it, sine and cosine.

        Args:
            base: The link that all hangs on instead of the root.

        Raises:
            ValueError: If a joint between it and the root makes no sense; it names the joint.
        """
        root = copy.deepcopy(self._root)
        if base is not None:
            _hang_on(root, base)
        for joint in root.findall("joint"):
            if joint.get("type") == "continuous":
                joint.set("type", "revolute")
                if joint.find("limit") is None:
                    joint.append(_element("limit", effort="0", velocity="0"))
                for limit in joint.iterfind("limit"):
                    limit.attrib.update(lower="0", upper="0")
        return _text(root)

    def root_link(self) -> str:
        """Returns the name of the link that everything else hangs on.

        Raises:
            ConfigError: If there is not one link that is no joint's child.
        """
        children = {_end(joint, "child") for joint in self._joints}
        roots = [link for link in self.links if link not in children]
        if len(roots) != 1:
            message = f"expected one link that is no joint's child, found {', '.join(roots) or 'none'}"
            raise ConfigError([Problem(self.path, "", message)])
        return roots[0]

    def mounted_on(self, joints: Sequence[UrdfJoint]) -> str:
        """Returns all of it with a chain of massless links above the root, and with absolute names of meshes.

        Args:
            joints: The joints of the chain, from its fixed end to the root.
        """
        robot = self._absolute()
        root = next(link for link in robot.findall("link") if link.get("name") == joints[-1].child)
        if root.find("inertial") is None:
            root.append(_inertial("0"))  # PyBullet gives 1 kg to any link without, unless it is the fixed one
        robot.remove(root)
        links = [_element("link", _inertial("0"), name=joint.parent) for joint in joints]
        robot[:0] = [*links, root]  # in order, in case of URDF_MAINTAIN_LINK_ORDER
        robot.extend(map(_joint_element, joints))
        return _text(robot)

    def for_window(self) -> str | None:
        """Returns all of it with the first visual of each link at its end, with absolute names of meshes.

        PyBullet's window draws a whole link in the colour of its last visual; the first one is the link's main one, as
        a rule.

        Returns:
            Nothing if no link has several.
        """
        robot = self._absolute()
        several = [link for link in robot.findall("link") if len(link.findall("visual")) > 1]
        for link in several:
            first = link.findall("visual")[0]
            link.remove(first)
            link.append(first)
        return _text(robot) if several else None

    def _absolute(self) -> Element:
        """Returns a copy that may stand in another folder, since names of meshes and textures are absolute."""
        robot = copy.deepcopy(self._root)
        for element in robot.iterfind(".//*[@filename]"):
            name = element.get("filename", "")
            element.set("filename", str(beside_or_above(name, self._source) or name))
        return robot


def mimics_of(path: str) -> dict[str, Mimic]:
    """Returns what joints of a URDF file follow others, by name; none if it cannot be read as PyBullet may do.

    Raises:
        ValueError: If a value makes no sense; it names the joint.
    """
    with suppress(ConfigError, OSError):
        if b"<mimic" in read_file(path, MOST_BYTES):  # saves most files the parsing
            return UrdfDocument(path).mimics
    return {}


def disabled_collisions(path: str) -> set[frozenset[str]]:
    """Returns the pairs of links of which a SRDF file says that they need not be kept apart.

    Raises:
        ConfigError: If it cannot be read or is not well-formed.
    """
    try:
        root = _parse(read_file(path, MOST_BYTES).decode(errors="replace"))
    except (OSError, expat.ExpatError, RecursionError) as error:
        raise ConfigError([Problem(path, "", f"expected a SRDF file: {error}")]) from None
    return {frozenset((pair.get("link1", ""), pair.get("link2", ""))) for pair in root.iter("disable_collisions")}


def chain_urdf(joints: Sequence[UrdfJoint]) -> str:
    """Returns a URDF of a chain of joints with bare links, from its base to its tip."""
    links = [_element("link", name=name) for name in (joints[0].parent, *(joint.child for joint in joints))]
    return _text(_element("robot", *links, *map(_joint_element, joints), name="chain"))


def _hang_on(robot: Element, base: str) -> None:
    """Turns the joints between a link and the root around, with further links; their positions mean what they did."""
    above = {_end(joint, "child"): joint for joint in robot.findall("joint")}
    link = base
    while (joint := above.pop(link, None)) is not None:
        name, parent = joint.get("name", ""), _end(joint, "parent")
        x, y, z = _vector(joint, "origin", "xyz", "0 0 0")
        roll, pitch, yaw = _vector(joint, "origin", "rpy", "0 0 0")
        backwards = scaled(-1.0, _vector(joint, "axis", "xyz", "1 0 0"))
        for part in ("origin", "axis", "parent", "child"):
            for element in joint.findall(part):
                joint.remove(element)
        # A joint moves where its origin puts it, so the origin comes back afterwards, one turn after the other.
        steps = (
            ("rpy", (-roll, 0.0, 0.0)),
            ("rpy", (0.0, -pitch, 0.0)),
            ("rpy", (0.0, 0.0, -yaw)),
            ("xyz", (-x, -y, -z)),
        )
        ends = [*(f"{name}/{number}" for number in range(len(steps))), parent]
        joint.extend([_element("parent", link=link), _element("child", link=ends[0])])
        joint.append(_element("axis", xyz=_words(backwards)))
        for (kind, vector), start, end in zip(steps, ends, ends[1:]):
            between = [_element("parent", link=start), _element("child", link=end)]
            origin = _element("origin", **{kind: _words(vector)})
            robot.append(_element("link", name=start))
            robot.append(_element("joint", *between, origin, name=f"{start}/fixed", type="fixed"))
        link = parent


def _parse(text: str) -> Element:
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


def _read_joint(element: Element) -> UrdfJoint:
    """Reads a joint; as in PyBullet, lower limits that are not below the upper ones mean that there are none.

    Raises:
        ValueError: If a value makes no sense; it names the joint.
    """
    name, kind = element.get("name", ""), element.get("type", "")
    lower, upper, speed = (_number(element, "limit", key, "0") for key in ("lower", "upper", "velocity"))
    if kind == "continuous" or not lower < upper:
        lower, upper = -math.inf, math.inf
    x, y, z = _vector(element, "axis", "xyz", "1 0 0")
    length = math.hypot(x, y, z)
    if kind in MOVING and length < 1e-6:
        raise ValueError(f"joint '{name}': axis: must not be zero")
    return UrdfJoint(
        name=name,
        type=kind,
        parent=_end(element, "parent"),
        child=_end(element, "child"),
        xyz=_vector(element, "origin", "xyz", "0 0 0"),
        rpy=_vector(element, "origin", "rpy", "0 0 0"),
        axis=(x / length, y / length, z / length) if length else (1.0, 0.0, 0.0),
        lower=lower,
        upper=upper,
        max_velocity=speed if speed > 0.0 else math.inf,
        mimic=_mimic(element),
    )


def _mimic(element: Element) -> Mimic | None:
    if element.find("mimic") is None:
        return None
    multiplier = _number(element, "mimic", "multiplier", "1")
    if multiplier == 0.0:
        raise ValueError(f"joint '{element.get('name', '')}': mimic.multiplier: must not be 0")
    return Mimic(_attribute(element, "mimic", "joint"), multiplier, _number(element, "mimic", "offset", "0"))


def _end(joint: Element, end: str) -> str:
    """Returns the link at an end of a joint, `parent` or `child`."""
    return _attribute(joint, end, "link")


def _attribute(element: Element, part: str, key: str, default: str = "") -> str:
    found = element.find(part)
    return default if found is None else found.get(key, default)


def _number(joint: Element, part: str, key: str, default: str) -> float:
    return _numbers(joint, part, key, default)[0]


def _vector(joint: Element, part: str, key: str, default: str) -> Vector:
    x, y, z = _numbers(joint, part, key, default)
    return x, y, z


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


def _joint_element(joint: UrdfJoint) -> Element:
    """Returns a joint with what counts for positions."""
    unlimited = joint.lower == -math.inf
    parts = [_element("parent", link=joint.parent), _element("child", link=joint.child)]
    parts.append(_element("origin", xyz=_words(joint.xyz), rpy=_words(joint.rpy)))
    if joint.is_moving:
        lower, upper = (1.0, -1.0) if unlimited else (joint.lower, joint.upper)
        parts.append(_element("axis", xyz=_words(joint.axis)))
        parts.append(_element("limit", lower=repr(lower), upper=repr(upper), effort="0", velocity="0"))
    kind = "continuous" if unlimited and joint.type == "revolute" else joint.type
    return _element("joint", *parts, name=joint.name, type=kind)


def _inertial(mass: str) -> Element:
    """Returns a mass [kg], and as much inertia about each axis [kg m^2], at the link's frame."""
    inertia = {"ixx": mass, "iyy": mass, "izz": mass, "ixy": "0", "ixz": "0", "iyz": "0"}
    return _element("inertial", _element("mass", value=mass), _element("inertia", **inertia))


def _element(tag: str, /, *parts: Element, **attributes: str) -> Element:
    element = Element(tag, attributes)
    element.extend(parts)
    return element


def _words(vector: Vector) -> str:
    return " ".join(map(repr, vector))


def _text(element: Element) -> str:
    """Returns the text of an element, with a line for each tag: PyBullet cannot read very long lines."""
    return ElementTree.tostring(element, encoding="unicode").replace("><", ">\n<")
