"""Robot descriptions without anything but links and joints."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

from custom_ros_tools.errors import ConfigError, Problem

_ROBOT = re.compile(r"<robot\b.*</robot\s*>", re.DOTALL)
_SOLVABLE = ("revolute", "continuous", "prismatic", "fixed")


class Skeleton:
    """The links and joints of a robot description, without shapes.

    It loads in half a millisecond where meshes take up to some hundred. Every link has unit mass at its own frame, so
    that PyBullet's frames of mass centres are the links' frames.

    Args:
        path: A URDF file; the meshes it names need not be there.

    Raises:
        ConfigError: If it cannot be read or is not well-formed.
    """

    def __init__(self, path: str) -> None:
        try:
            text = Path(path).read_text(encoding="utf-8", errors="replace")
            match = _ROBOT.search(text)  # PyBullet does not mind what stands before or behind
            self._root = ElementTree.fromstring(match[0] if match else text)
        except OSError as error:
            raise ConfigError([Problem(path, "", (error.strerror or str(error)).lower())]) from None
        except ElementTree.ParseError as error:
            raise ConfigError([Problem(path, "", f"expected well-formed XML: {error}")]) from None
        for link in self._root.findall("link"):
            link[:] = [_unit_inertial()]

    def text(self) -> str:
        """Returns all of it as a URDF."""
        return ElementTree.tostring(self._root, encoding="unicode")

    def chain(self, link_name: str) -> str:
        """Returns a URDF of what is between the root and one link, both included.

        Raises:
            ValueError: If a joint in between is neither fixed, revolute nor prismatic; it names the joint.
        """
        above = {_end(joint, "child"): joint for joint in self._root.findall("joint")}
        links, joints = [link_name], []
        while (joint := above.get(links[-1])) is not None:
            if joint.get("type") not in _SOLVABLE:
                kind = f"a {joint.get('type')} joint; only revolute and prismatic ones are solved for"
                raise ValueError(f"'{link_name}' hangs on '{joint.get('name')}', {kind}")
            joints.append(joint)
            links.append(_end(joint, "parent"))
        chain = ElementTree.Element("robot", self._root.attrib)
        chain.extend(link for link in self._root.findall("link") if link.get("name") in links)
        chain.extend(joints)
        return ElementTree.tostring(chain, encoding="unicode")


def _end(joint: ElementTree.Element, end: str) -> str:
    """Returns the link at an end of a joint, `parent` or `child`."""
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def _unit_inertial() -> ElementTree.Element:
    """Returns mass and inertia of 1 at the link's frame."""
    inertial = ElementTree.Element("inertial")
    ElementTree.SubElement(inertial, "mass", value="1")
    ElementTree.SubElement(inertial, "inertia", ixx="1", ixy="0", ixz="0", iyy="1", iyz="0", izz="1")
    return inertial
