"""Reads URDF files, and the disabled collisions in SRDF files."""

from collections.abc import Iterator
from contextlib import suppress
from functools import cached_property, lru_cache
from pathlib import Path
from typing import NamedTuple
from xml.parsers import expat

from custom_ros_tools.config import read_file
from custom_ros_tools.errors import ConfigError, Problem, shortened

from .elements import READ, Element, Mimic, UrdfJoint, end_of, parse, read_joint, read_mimic
from .files import mesh_file

MAX_BYTES = 2_000_000
"""Largest length of a file [bytes]; longer files are refused."""


class Edge(NamedTuple):
    """Names of a joint and of the two links that it connects."""

    joint: str
    parent: str
    child: str


class Attribute(NamedTuple):
    """An XML attribute in a URDF.

    Attributes:
        owner: Tag and name of the link or joint that contains the attribute, for messages.
        tag: Tag of the element that has the attribute.
        key: Name of the attribute.
        text: Value of the attribute.
        is_read: Whether PyBullet reads the element.
    """

    owner: str
    tag: str
    key: str
    text: str
    is_read: bool


class UrdfDocument:
    """The links and joints of a URDF file.

    Like PyBullet, the parser ignores text outside the robot element, and characters that XML does not allow. Documents
    with the same content compare equal and share their elements, so callers must not change them.

    Args:
        path: Path of the URDF; its meshes need not exist.
        source: File to read instead of `path`; error messages name `path`.
        not_xml: Start of the error message for a file that is not well-formed.

    Attributes:
        tag: Tag of the top element, `robot` in a URDF.
        links: Names of all links.
        joint_types: Type of each joint, such as `revolute` or `fixed`, indexed by joint name.
        edges: Names of each joint and of the two links that the joint connects, in the file's order.
        meshes: File names of all meshes, as written in the file.
        source: Path of the file that was read.
        root: The top element.
        joint_elements: The elements of the joints.

    Raises:
        ConfigError: If the file cannot be read or is not well-formed.
    """

    def __init__(self, path: str, source: str | None = None, not_xml: str = "is not XML") -> None:
        self.path, self.source = path, Path(source or path)
        try:
            self.root = _robot_in(read_file(self.source, MAX_BYTES))
        except OSError as error:
            raise ConfigError([Problem(path, "", (error.strerror or str(error)).lower())]) from None
        except (expat.ExpatError, RecursionError) as error:
            raise ConfigError([Problem(path, "", f"{not_xml}: {error}")]) from None
        self.tag = self.root.tag
        self.joint_elements, self.links, self.joint_types, self.meshes, self.edges = _parts_of(self.root)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, UrdfDocument) and self.root is other.root

    def __hash__(self) -> int:
        return id(self.root)

    @cached_property
    def joints(self) -> dict[str, UrdfJoint]:
        """All joints, indexed by name.

        Raises:
            ValueError: If a value of a joint is invalid; the message names the joint.
        """
        return {joint.name: joint for joint in map(read_joint, self.joint_elements)}

    @cached_property
    def mimics(self) -> dict[str, Mimic]:
        """Relation of each mimic joint to the followed joint, indexed by mimic joint name.

        Raises:
            ValueError: If a value of a relation is invalid; the message names the joint.
        """
        found = {joint.get("name", ""): read_mimic(joint) for joint in self.joint_elements}
        return {name: mimic for name, mimic in found.items() if mimic is not None}

    def meshes_of(self, part: str) -> list[str]:
        """Returns the file names of all `visual` or `collision` meshes, as written in the file.

        Args:
            part: `visual` or `collision`.
        """
        found = self.root.iterfind(f"link/{part}//mesh")
        return list(dict.fromkeys(mesh.get("filename", "") for mesh in found))

    def attributes(self) -> Iterator[Attribute]:
        """Yields all XML attributes of the top element and of all nested elements."""
        for key, text in self.root.attrib.items():
            yield Attribute(self.tag, "robot", key, text, True)
        for owner in self.root:
            name = f"{owner.tag} '{shortened(owner.get('name', ''))}'"
            is_read = owner.tag in READ
            for element in owner.iter():
                for key, text in element.attrib.items():
                    yield Attribute(name, element.tag, key, text, is_read and element.tag in READ)

    @cached_property
    def frames(self) -> set[str]:
        """Names of the links that have neither an inertia nor a shape."""
        parts = ("inertial", "visual", "collision")
        links = (link for link in self.root.findall("link") if all(link.find(part) is None for part in parts))
        return {link.get("name", "") for link in links}

    @cached_property
    def massless(self) -> set[str]:
        """Names of the links whose mass is 0."""
        masses = ((link.get("name", ""), link.find("inertial/mass")) for link in self.root.findall("link"))
        return {name for name, mass in masses if mass is not None and not float(mass.get("value") or 0.0)}

    @property
    def is_soft(self) -> bool:
        """Whether the file describes a soft body."""
        return self.root.find("deformable") is not None

    def deformable_meshes(self) -> list[str]:
        """Returns the paths of the soft body's mesh files; an empty list for a file without a soft body.

        Raises:
            ConfigError: If a mesh does not exist, or its package is unknown.
        """
        names = [part.get("filename") for deformable in self.root.findall("deformable") for part in deformable]
        return [str(mesh_file(name, self.source)) for name in dict.fromkeys(names) if name]

    def joints_above(self, link: str) -> Iterator[tuple[str, str, str]]:
        """Yields the name, type and parent link of each joint on the way from a link up to the root."""
        above = {end_of(joint, "child"): joint for joint in self.joint_elements}
        while (joint := above.pop(link, None)) is not None:
            link = end_of(joint, "parent")
            yield joint.get("name", ""), joint.get("type", ""), link

    def root_link(self) -> str:
        """Returns the name of the root link.

        Raises:
            ConfigError: If the number of links that are not a joint's child differs from one.
        """
        children = {end_of(joint, "child") for joint in self.joint_elements}
        roots = [link for link in self.links if link not in children]
        if len(roots) != 1:
            message = f"expected one link that is no joint's child, found {', '.join(roots) or 'none'}"
            raise ConfigError([Problem(self.path, "", message)])
        return roots[0]


@lru_cache(maxsize=32)
def _robot_in(data: bytes) -> Element:
    """Parses the robot element in a file's content; results are cached."""
    return parse(data.decode(errors="replace"))


class _Parts(NamedTuple):
    joint_elements: list[Element]
    links: list[str]
    joint_types: dict[str, str]
    meshes: list[str]
    edges: list[Edge]


@lru_cache(maxsize=32)
def _parts_of(root: Element) -> _Parts:
    joints = root.findall("joint")
    return _Parts(
        joints,
        [link.get("name", "") for link in root.findall("link")],
        {joint.get("name", ""): joint.get("type", "") for joint in joints},
        list(dict.fromkeys(mesh.get("filename", "") for mesh in root.iter("mesh"))),
        [Edge(joint.get("name", ""), end_of(joint, "parent"), end_of(joint, "child")) for joint in joints],
    )


def mimics_of(path: str) -> dict[str, Mimic]:
    """Returns a URDF file's mimic relations, see `UrdfDocument.mimics`; an empty dict if the file cannot be read.

    Raises:
        ValueError: If a value of a relation is invalid; the message names the joint.
    """
    with suppress(ConfigError):
        return UrdfDocument(path).mimics
    return {}


def disabled_collisions(path: str) -> set[frozenset[str]]:
    """Returns the pairs of links whose collisions an SRDF file disables.

    Raises:
        ConfigError: If the file cannot be read or is not well-formed.
    """
    try:
        root = _robot_in(read_file(path, MAX_BYTES))
    except (OSError, expat.ExpatError, RecursionError) as error:
        raise ConfigError([Problem(path, "", f"expected an SRDF file: {error}")]) from None
    return {frozenset((pair.get("link1", ""), pair.get("link2", ""))) for pair in root.iter("disable_collisions")}
