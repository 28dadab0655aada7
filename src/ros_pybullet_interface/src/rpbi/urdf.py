"""Robot description files."""

from __future__ import annotations

import atexit
import hashlib
import re
import tempfile
import xml.etree.ElementTree as ElementTree
from functools import lru_cache
from pathlib import Path

from custom_ros_tools.config import replace_package
from custom_ros_tools.errors import ConfigError, Problem

_FILENAME = re.compile(r"""(?P<before>filename\s*=\s*)(?P<quote>["'])(?P<path>.*?)(?P=quote)""")


@lru_cache(maxsize=1)
def _folder() -> Path:
    """Returns a folder for this process's rewritten files; it goes when the process ends."""
    folder = tempfile.TemporaryDirectory(prefix="rpbi-urdf-")
    atexit.register(folder.cleanup)
    return Path(folder.name)


def resolve_meshes(path: str) -> str:
    """Makes the meshes of a URDF file loadable by PyBullet, which knows nothing of ROS packages.

    Args:
        path: The URDF file.

    Returns:
        The file itself if it needs nothing, else that of a copy in which every `package://` path, and with them
        every relative one, is absolute.

    Raises:
        ConfigError: If a mesh belongs to an unknown package or does not exist.
    """
    source = Path(path)
    text = source.read_text(encoding="utf-8")
    if "package://" not in text:
        return path
    problems: list[Problem] = []

    def absolute(match: re.Match[str]) -> str:
        mesh = match["path"]
        try:
            resolved = Path(replace_package(mesh))
        except ConfigError as error:
            problems.extend(Problem(str(source), mesh, problem.message) for problem in error.problems)
            return match[0]
        resolved = source.parent / resolved
        if not resolved.is_file():
            problems.append(Problem(str(source), mesh, f"no such file: {resolved}"))
        return f"{match['before']}{match['quote']}{resolved}{match['quote']}"

    resolved_text = _FILENAME.sub(absolute, text)
    if problems:
        raise ConfigError(problems)
    return _write(source.stem, resolved_text)


def write_description(text: str) -> str:
    """Writes a robot description that has no file, such as that of the parameter server, into one of its own.

    Returns:
        The file, which lasts as long as the process.
    """
    return _write("robot_description", text)


def description_for_ros(path: str) -> str:
    """Returns a URDF file as ROS wants it, which does not know where the file is.

    Args:
        path: The file.

    Returns:
        Its text, with relative mesh paths as `file://` addresses; `package://` paths stay.
    """
    source = Path(path)

    def address(match: re.Match[str]) -> str:
        mesh = match["path"]
        if "://" in mesh:
            return match[0]
        return f"{match['before']}{match['quote']}file://{(source.parent / mesh).resolve()}{match['quote']}"

    return _FILENAME.sub(address, source.read_text(encoding="utf-8"))


def joint_types(path: str) -> dict[str, str]:
    """Returns the type of each joint in a URDF file by name, such as `revolute` or `fixed`.

    Raises:
        ConfigError: If the file is not XML.
    """
    try:
        joints = ElementTree.parse(path).getroot().iterfind("joint")
    except ElementTree.ParseError as error:
        raise ConfigError([Problem(path, "", f"is not XML: {error}")]) from None
    return {joint.get("name", ""): joint.get("type", "") for joint in joints}


def _write(stem: str, text: str) -> str:
    path = _folder() / f"{stem}-{hashlib.sha256(text.encode()).hexdigest()[:12]}.urdf"
    path.write_text(text, encoding="utf-8")
    return str(path)
