"""Makes modified copies of a URDF that PyBullet can load; does not import PyBullet."""

import logging
from collections.abc import Mapping, Sequence
from functools import lru_cache

from custom_ros_tools.errors import ConfigError, Problem, shortened

from .document import UrdfDocument
from .elements import READ, Element, UrdfJoint, as_read, end_of, inertial, joint_element, new_element
from .files import beside_or_above, found_mesh

log = logging.getLogger(__name__)

WORLD_LINK = "world"
"""Link name that PyBullet treats specially: a link `world` without inertia has mass 0, and a root `world` is fixed."""
LEAST_KG = "1e-06"
"""Mass assigned to a free root without inertia and shape [kg]. PyBullet would fix a massless root to the world."""
Files = tuple[tuple[tuple[str, str], str], ...]
"""Pairs of an element, given by tag and `filename` attribute, and the absolute path of the element's file."""


def files_of(document: UrdfDocument) -> Files:
    """Returns the paths of the meshes and textures that PyBullet reads with a URDF, without missing textures.

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
    """Copies the elements of a URDF that PyBullet reads, and replaces file names by absolute paths.

    PyBullet itself does not resolve names of ROS packages.

    Args:
        document: The URDF.
        files: Result of `files_of`; elements whose file is not in `files` are left out.
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


def mounted_on(robot: Element, root_link: str, joints: Sequence[UrdfJoint]) -> None:
    """Adds a chain of massless links and of joints above the root of a robot.

    Args:
        robot: Top element of the URDF, which is changed in place.
        root_link: Name of the robot's root link.
        joints: Joints of the chain, from the fixed end of the chain to the robot's root.
    """
    root = next(link for link in robot.findall("link") if link.get("name") == root_link)
    if root.find("inertial") is None:
        root.append(inertial("0"))  # PyBullet would assign 1 kg to a link without inertial element
    robot.remove(root)
    links = [new_element("link", inertial("0"), name=joint.parent) for joint in joints]
    robot[:0] = [*links, root]  # parents first, as URDF_MAINTAIN_LINK_ORDER requires
    robot.extend(map(joint_element, joints))


def frame_masses(document: UrdfDocument, is_fixed: bool) -> dict[str, str]:
    """Returns the masses to assign to frames: links without inertia and shape, which PyBullet would give 1 kg each.

    Most frames get mass 0. A free root gets `LEAST_KG` if a link with mass is fixed to the root, since PyBullet needs
    some mass on free bodies. The result leaves out frames that keep 1 kg: a frame on a moving joint that does not carry
    another mass, and a free root to which no mass is fixed.

    Args:
        document: The URDF.
        is_fixed: Whether the base is fixed to the world.

    Returns:
        Mass of each frame as text [kg], indexed by link name.
    """
    frames = document.frames - {WORLD_LINK}
    if not frames:
        return {}
    above = {edge.child: edge for edge in document.edges}
    # carries: links at or below which there is mass. holds: links with mass, or with mass fixed to them.
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
    """Returns the names of all links; each parent comes before its children."""
    below: dict[str, list[str]] = {}
    for edge in document.edges:
        below.setdefault(edge.parent, []).append(edge.child)
    ordered = [document.root_link()]
    for link in ordered:
        ordered += below.get(link, [])
    return ordered


def weigh_frames(robot: Element, masses: Mapping[str, str]) -> None:
    """Adds an inertial element to each link of a robot that has an entry in `masses`, the result of `frame_masses`."""
    for link in robot.findall("link"):
        if (mass := masses.get(link.get("name", ""))) is not None:
            link.append(inertial(mass))


def weighed_by_pybullet(document: UrdfDocument, is_fixed: bool) -> list[str]:
    """Returns the names of the movable links to which PyBullet assigns 1 kg because the URDF does not give a mass."""
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
    """Moves the root link before all other links; in another order, URDF_MAINTAIN_LINK_ORDER crashes PyBullet."""
    children = {end_of(joint, "child") for joint in robot.findall("joint")}
    for root in [link for link in robot.findall("link") if link.get("name") not in children]:
        robot.remove(root)
        robot.insert(0, root)


def put_first_visuals_last(robot: Element) -> None:
    """Moves the first visual of each link behind the link's other visuals.

    PyBullet's window draws a whole link in the colour of the last visual. The first visual is usually the main one.
    """
    for link in robot.findall("link"):
        if len(visuals := link.findall("visual")) > 1:
            link.remove(visuals[0])
            link.append(visuals[0])
