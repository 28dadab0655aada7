"""Joints that let the root link of a robot description move in a plane."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from custom_ros_tools.errors import ConfigError, Problem

from .document import read_urdf, resolve_meshes, write_description

PLANAR_JOINTS = (0, 1, 2)
"""PyBullet's indices of the joints along x and y [m] and about z [rad], and of the links behind them."""
_AXES = (("x", "prismatic", "1 0 0"), ("y", "prismatic", "0 1 0"), ("yaw", "continuous", "0 0 1"))
_MASSLESS = {"mass": {"value": "0"}, "inertia": dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), "0")}


def with_planar_joints(path: str) -> str:
    """Puts a massless chain of joints along x, along y and about z between the world and a robot's root link.

    Args:
        path: The robot's URDF file.

    Returns:
        A copy of it with the chain, which lasts as long as the process; its root is the fixed end of the chain.

    Raises:
        ConfigError: If the file is not a tree of links, or a mesh of it does not exist.
    """
    source = Path(resolve_meshes(path))
    try:
        robot = ElementTree.fromstring(read_urdf(str(source)).strip())
    except ElementTree.ParseError as error:
        raise ConfigError([Problem(path, path, f"is not XML: {error}")]) from None
    for element in robot.iterfind(".//*[@filename]"):  # meshes and textures
        element.set("filename", _found(element.get("filename", ""), source))
    root = _root_link(robot, path)
    if root.find("inertial") is None:
        root.append(_massless())  # PyBullet gives 1 kg to any link without, unless it is the fixed one
    names = [f"planar_base/{axis}" for axis, _, _ in _AXES]
    links = ["planar_base/world", *names[:-1], root.get("name", "")]
    robot.remove(root)
    robot[:0] = [*map(_massless_link, links[:-1]), root]  # in order, in case of URDF_MAINTAIN_LINK_ORDER
    for name, (_, kind, axis), parent, child in zip(names, _AXES, links, links[1:]):
        joint = ElementTree.SubElement(robot, "joint", name=name, type=kind)
        ElementTree.SubElement(joint, "parent", link=parent)
        ElementTree.SubElement(joint, "child", link=child)
        ElementTree.SubElement(joint, "axis", xyz=axis)
        ElementTree.SubElement(joint, "limit", lower="1", upper="0", effort="0", velocity="0")  # inverted: no limits
    return write_description(ElementTree.tostring(robot, encoding="unicode"))


def _found(name: str, urdf: Path) -> str:
    """Returns where PyBullet finds a file that a URDF file names: beside it or in a folder above."""
    return next((str(folder / name) for folder in urdf.absolute().parents if (folder / name).is_file()), name)


def _root_link(robot: ElementTree.Element, path: str) -> ElementTree.Element:
    children = {child.get("link") for child in robot.iterfind("joint/child")}
    roots = [link for link in robot.iterfind("link") if link.get("name") not in children]
    if len(roots) != 1:
        names = ", ".join(str(link.get("name")) for link in roots) or "none"
        raise ConfigError([Problem(path, path, f"expected one link that is no joint's child, found {names}")])
    return roots[0]


def _massless_link(name: str) -> ElementTree.Element:
    link = ElementTree.Element("link", name=name)
    link.append(_massless())
    return link


def _massless() -> ElementTree.Element:
    inertial = ElementTree.Element("inertial")
    for tag, attributes in _MASSLESS.items():
        ElementTree.SubElement(inertial, tag, attributes)
    return inertial
