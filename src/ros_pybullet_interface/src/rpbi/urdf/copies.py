"""Changed copies of a URDF."""

import copy
import logging
from collections.abc import Mapping, Sequence
from functools import lru_cache

from custom_ros_tools.errors import ConfigError, Problem, shortened
from rpbi.geometry import scaled

from .document import UrdfDocument
from .elements import (
    READ,
    Element,
    UrdfJoint,
    as_read,
    end_of,
    inertial,
    joint_element,
    new_element,
    read_vector,
    text_of,
    words,
)
from .files import address_for_ros, beside_or_above, found_mesh

log = logging.getLogger(__name__)

Files = tuple[tuple[tuple[str, str], str], ...]
"""Absolute names of files by the tag and the `filename` of the elements that name them."""


def files_of(document: UrdfDocument) -> Files:
    """Returns the files that PyBullet reads beside a URDF; textures that are no ordinary files are left out.

    Raises:
        ConfigError: If a mesh belongs to an unknown package or does not exist.
    """
    files: list[tuple[tuple[str, str], str]] = []
    problems: list[Problem] = []
    for tag, name in _named_files(document):
        try:
            texture = beside_or_above(name, document.source) if tag == "texture" else None
            if tag != "texture":
                files.append(((tag, name), str(found_mesh(name, document.source))))
            elif texture is not None:
                files.append(((tag, name), str(texture)))
            else:
                log.info("%s: no such texture: %s", document.path, shortened(name))
        except ConfigError as error:
            problems += error.problems
        except OSError as error:
            problems.append(Problem(document.path, "", str(error)))
    if problems:
        raise ConfigError(problems)
    return tuple(files)


@lru_cache(maxsize=32)
def _named_files(document: UrdfDocument) -> tuple[tuple[str, str], ...]:
    parts = [part for child in document.root if child.tag in READ for part in as_read(child).iter()]
    return tuple(dict.fromkeys((part.tag, part.get("filename", "")) for part in parts if "filename" in part.attrib))


def for_pybullet(document: UrdfDocument, files: Files) -> Element:
    """Returns what PyBullet, which does not resolve ROS packages, reads of a URDF, with the file names of `files_of`.

    The result depends on the arguments alone.
    """
    robot, known = as_read(document.root), dict(files)
    for parent in list(robot.iter()):
        for element in [child for child in parent if "filename" in child.attrib]:
            file = known.get((element.tag, element.get("filename", "")))
            if file is None:
                parent.remove(element)
            else:
                element.set("filename", file)
    return robot


def description_for_ros(path: str) -> str:
    """Returns a URDF file as ROS wants it, which does not know where the file is.

    Returns:
        Its text, with relative mesh paths as `file://` addresses; paths of ROS packages stay.

    Raises:
        ConfigError: If it is no URDF, or a mesh belongs to an unknown package.
    """
    document = UrdfDocument(path)
    robot = copy.deepcopy(document.root)
    for tag in ("mesh", "texture"):
        for element in robot.iterfind(f".//{tag}[@filename]"):
            element.set("filename", address_for_ros(element.get("filename", ""), document.source))
    return text_of(robot)


WORLD_LINK = "world"
"""The link that PyBullet takes for the world: without inertia it weighs nothing, and as a root it is fixed."""
LEAST_KG = "1e-06"
"""Mass of a floating root that is a mere frame [kg]: PyBullet would fix one without mass to the world."""


def without_shapes(document: UrdfDocument, links: Sequence[str] | None = None) -> str:
    """Returns a URDF without shapes, of all or some links and the joints between them.

    It loads in half a millisecond where meshes take up to some hundred. Every link has unit mass at its own frame, so
    that PyBullet's frames of mass centres are the links' frames.
    """
    root = document.root_link()
    kept = sorted((name for name in document.links if links is None or name in links), key=lambda name: name != root)
    ends = {*kept}
    every = document.joint_elements
    tied = (one for one in every if links is None or {end_of(one, "parent"), end_of(one, "child")} <= ends)
    joints = map(as_read, tied)
    bare = [new_element("link", inertial("1"), name=name) for name in kept]
    return text_of(new_element("robot", *bare, *joints, **document.root.attrib))


def with_limited_joints(document: UrdfDocument, base: str | None = None) -> str:
    """Returns a URDF with limits from 0 to 0, which mean none, for joints that turn without end.

    So each of them has one number in Pinocchio, which else has two for it, sine and cosine.

    Args:
        base: The link that all hangs on instead of the root.

    Raises:
        ValueError: If a joint between it and the root makes no sense; it names the joint.
    """
    root = copy.deepcopy(document.root)
    if base is not None:
        _hang_on(root, base)
    for joint in root.findall("joint"):
        if joint.get("type") == "continuous":
            joint.set("type", "revolute")
            if joint.find("limit") is None:
                joint.append(new_element("limit", effort="0", velocity="0"))
            for limit in joint.iterfind("limit"):
                limit.attrib.update(lower="0", upper="0")
    return text_of(root)


def mounted_on(robot: Element, root_link: str, joints: Sequence[UrdfJoint]) -> None:
    """Puts a chain of massless links above the root of a robot.

    Args:
        robot: The robot, which is changed.
        root_link: The name of its root.
        joints: The joints of the chain, from its fixed end to the root.
    """
    root = next(link for link in robot.findall("link") if link.get("name") == root_link)
    if root.find("inertial") is None:
        root.append(inertial("0"))  # PyBullet gives 1 kg to any link without, unless it is the fixed one
    robot.remove(root)
    links = [new_element("link", inertial("0"), name=joint.parent) for joint in joints]
    robot[:0] = [*links, root]  # in order, in case of URDF_MAINTAIN_LINK_ORDER
    robot.extend(map(joint_element, joints))


def frame_masses(document: UrdfDocument, is_fixed: bool) -> dict[str, str]:
    """Returns the masses [kg] of links that are mere frames, which PyBullet would give 1 kg each.

    A frame is a link without inertia and shape. It weighs nothing, but PyBullet needs some mass where something moves
    freely: a root that is not fixed weighs `LEAST_KG`, if mass is fixed to it. Left out are frames on a moving joint
    that moves no mass, and a root that is neither fixed nor has mass fixed to it.

    Args:
        is_fixed: Whether the base is fixed to the world.
    """
    frames = document.frames - {WORLD_LINK}
    if not frames:
        return {}
    above = {edge.child: edge for edge in document.edges}
    # Mass that moves with a link, and that is fixed to it
    carries, holds = (set(document.links) - document.frames - document.massless for _ in range(2))
    for link in reversed(_from_the_root(document)):
        edge = above.get(link)
        if edge is not None and link in carries:
            carries.add(edge.parent)
        if edge is not None and link in holds and document.joint_types[edge.joint] == "fixed":
            holds.add(edge.parent)
    masses: dict[str, str] = {}
    for link in frames:
        if (edge := above.get(link)) is None:
            masses |= {link: LEAST_KG} if link in holds and not is_fixed else {}
        elif link in carries or document.joint_types[edge.joint] == "fixed":
            masses[link] = "0"
    return masses


def _from_the_root(document: UrdfDocument) -> list[str]:
    """Returns all links, each one after that on which it hangs."""
    below: dict[str, list[str]] = {}
    for edge in document.edges:
        below.setdefault(edge.parent, []).append(edge.child)
    ordered = [document.root_link()]
    for link in ordered:
        ordered += below.get(link, [])
    return ordered


def weigh_frames(robot: Element, masses: Mapping[str, str]) -> None:
    """Gives links of a robot, by name, masses [kg] such as `frame_masses` returns."""
    for link in robot.findall("link"):
        if (mass := masses.get(link.get("name", ""))) is not None:
            link.append(inertial(mass))


def weighed_by_pybullet(document: UrdfDocument, is_fixed: bool) -> list[str]:
    """Returns the links that can move and weigh 1 kg because the URDF says nothing of their mass."""
    above = {edge.child: edge for edge in document.edges}
    moving: set[str] = set()
    for link in _from_the_root(document):
        edge = above.get(link)
        is_free = not (is_fixed or link == WORLD_LINK) if edge is None else edge.parent in moving
        if is_free or (edge is not None and document.joint_types[edge.joint] != "fixed"):
            moving.add(link)
    silent = {link.get("name", "") for link in document.root.findall("link") if link.find("inertial") is None}
    missing = moving & silent - frame_masses(document, is_fixed).keys()
    return [link for link in document.links if link in missing]


def put_root_first(robot: Element) -> None:
    """Puts the root link of a robot before all others: PyBullet dies of others with URDF_MAINTAIN_LINK_ORDER."""
    children = {end_of(joint, "child") for joint in robot.findall("joint")}
    for root in [link for link in robot.findall("link") if link.get("name") not in children]:
        robot.remove(root)
        robot.insert(0, root)


def put_first_visuals_last(robot: Element) -> None:
    """Puts the first visual of each link of a robot at its end.

    PyBullet's window draws a whole link in the colour of its last visual; the first one is the link's main one, as
    a rule.
    """
    for link in robot.findall("link"):
        if len(visuals := link.findall("visual")) > 1:
            link.remove(visuals[0])
            link.append(visuals[0])


def chain_urdf(joints: Sequence[UrdfJoint]) -> str:
    """Returns a URDF of a chain of joints with bare links, from its base to its tip."""
    links = [new_element("link", name=name) for name in (joints[0].parent, *(joint.child for joint in joints))]
    return text_of(new_element("robot", *links, *map(joint_element, joints), name="chain"))


def _hang_on(robot: Element, base: str) -> None:
    """Turns the joints between a link and the root around, with further links; their positions mean what they did."""
    above = {end_of(joint, "child"): joint for joint in robot.findall("joint")}
    link = base
    while (joint := above.pop(link, None)) is not None:
        name, parent = joint.get("name", ""), end_of(joint, "parent")
        x, y, z = read_vector(joint, "origin", "xyz", "0 0 0")
        roll, pitch, yaw = read_vector(joint, "origin", "rpy", "0 0 0")
        backwards = scaled(-1.0, read_vector(joint, "axis", "xyz", "1 0 0"))
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
        joint.extend([new_element("parent", link=link), new_element("child", link=ends[0])])
        joint.append(new_element("axis", xyz=words(backwards)))
        for (kind, vector), start, end in zip(steps, ends, ends[1:]):
            between = [new_element("parent", link=start), new_element("child", link=end)]
            origin = new_element("origin", **{kind: words(vector)})
            robot.append(new_element("link", name=start))
            robot.append(new_element("joint", *between, origin, name=f"{start}/fixed", type="fixed"))
        link = parent
