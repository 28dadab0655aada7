"""Robot descriptions as Pinocchio likes them."""

from __future__ import annotations

from xml.etree import ElementTree

from custom_ros_tools.errors import ConfigError, Problem
from rpbi.urdf import read_urdf


def read_plain(urdf_path: str) -> tuple[str, dict[str, str]]:
    """Reads a robot description in which every joint with one axis shall have one number in Pinocchio.

    Args:
        urdf_path: The description.

    Returns:
        Its text, with limits, which mean none, for joints that turn without end; and the type of each joint by name.

    Raises:
        ConfigError: If it cannot be read.
    """
    try:
        root = ElementTree.fromstring(read_urdf(urdf_path))
    except ElementTree.ParseError as error:
        raise ConfigError([Problem(urdf_path, "", f"is not XML: {error}")]) from None
    except OSError as error:
        raise ConfigError([Problem(urdf_path, "", (error.strerror or str(error)).lower())]) from None
    types = {joint.get("name", ""): _make_plain(joint) for joint in root.findall("joint")}
    return ElementTree.tostring(root, encoding="unicode"), types


def _make_plain(joint: ElementTree.Element) -> str:
    """Makes a joint that turns without end one with limits, which has one number in Pinocchio; returns its type."""
    kind = joint.get("type", "")
    if kind == "continuous":
        joint.set("type", "revolute")
        limit = joint.find("limit")
        if limit is None:
            limit = ElementTree.SubElement(joint, "limit", effort="0", velocity="0")
        limit.set("lower", "0")
        limit.set("upper", "0")
    return kind
