"""Recognises the kind of a file from its content, to report a file of the wrong kind.

For example, a user may name a robot's file where the main file of a world is expected.
"""

from collections.abc import Collection, Mapping
from contextlib import suppress
from typing import Any

from custom_ros_tools.config import MAX_BYTES, load_config, read_file, replace_package
from custom_ros_tools.errors import ConfigError, Problem

_SECTIONS = {
    "robots": "a robot",
    "urdfs": "a URDF object",
    "soft_objects": "a soft object",
    "dynamic_objects": "a dynamic object",
    "collision_objects": "a collision object",
    "visual_objects": "a visual object",
    "rgbd_sensors": "a camera",
}
"""Kinds of files, indexed by the key of the main file's list that contains files of this kind."""
_OF_WORLDS = ("timeStep", "setGravity", "setPhysicsEngineParameter", "connect", *_SECTIONS)
_OF_ROBOTS = ("setJointMotorControlArray", "setJointMotorControlArrayParameters", "is_visual_robot")
_XML = {"robot": "a URDF", "launch": "a launch file", "sdf": "an SDF file", "mujoco": "an MJCF file"}
"""Kinds of XML files, indexed by the tag of the root element."""


def load_main_file(path: str) -> dict[str, Any]:
    """Returns the content of the main file of a world.

    Raises:
        ConfigError: If the file is not a YAML mapping. For a known kind of XML file, the message names this kind.
    """
    return _load(path, "a world")


def load_object_file(path: str) -> dict[str, Any]:
    """Returns the content of an object's file.

    Raises:
        ConfigError: If the file is not a YAML mapping. For a known kind of XML file, the message names this kind.
    """
    return _load(path, "an object file")


def _load(path: str, expected: str) -> dict[str, Any]:
    try:
        return load_config(path)
    except ConfigError:
        if kind := _kind_of_xml(path):
            message = f"is {kind}, not {expected}"
            if kind == _XML["robot"]:
                message += ": name it in an object file, as loadURDF: {fileName: FILE}"
                message += ", and list that under robots or urdfs" if expected == "a world" else ""
            raise ConfigError([Problem(path, "", message)]) from None
        raise


def _kind_of_xml(path: str) -> str:
    """Returns the kind of an XML file; empty if the file is not XML or its kind is not known."""
    with suppress(ConfigError, OSError, UnicodeDecodeError):
        text = read_file(replace_package(path), MAX_BYTES).decode().lstrip()
        if text.startswith("<"):
            first = [(text.find(f"<{tag}"), kind) for tag, kind in _XML.items() if f"<{tag}" in text]
            return min(first)[1] if first else ""
    return ""


def check_is_world(data: Mapping[str, Any], file: str) -> None:
    """Checks that the content of a main file is not the content of an object's or camera's file.

    Raises:
        ConfigError: If the file is an object's or camera's file; the message names the list to which the file belongs.
    """
    section = _section_of(data)
    if section and not any(key in data for key in _OF_WORLDS):
        message = f"is an object file ({_SECTIONS[section][2:]}), not a world: list it under {section} of a world"
        raise ConfigError([Problem(file, "", f"{message}, see docs/worlds.md")])


def check_is_listed_right(data: Mapping[str, Any], file: str, section: str, known: Collection[str]) -> None:
    """Checks that an object's file is in the main file's list for files of its kind.

    Args:
        data: Content of the object's file.
        file: Name of the object's file, for messages.
        section: Key of the list that contains the object's file.
        known: Keys that files in the list `section` may contain.

    Raises:
        ConfigError: If the file is of another kind; the message names the right list, unless the file is a world.
    """
    if section not in _SECTIONS:
        return
    unknown = {key: value for key, value in data.items() if key not in known}
    if any(key in unknown for key in _OF_WORLDS):
        raise ConfigError([Problem(file, "", f"is a world, not {_SECTIONS[section]}")])
    right = _section_of(data)
    is_decisive = _section_of(unknown) or any(key in unknown for key in _OF_ROBOTS)
    if right and right != section and is_decisive:
        message = f"is {_SECTIONS[right]}, not {_SECTIONS[section]}: list it under {right}"
        raise ConfigError([Problem(file, "", message)])


def _section_of(data: Mapping[str, Any]) -> str:
    """Returns the key of the main file's list to which a file belongs; empty if this is not clear from the content."""
    if "loadURDF" in data:
        return "robots" if any(key in data for key in _OF_ROBOTS) else "urdfs"
    for key, section in (
        ("loadSoftBody", "soft_objects"),
        ("baseMass", "dynamic_objects"),
        ("createCollisionShape", "collision_objects"),
        ("createVisualShape", "visual_objects"),
        ("intrinsics", "rgbd_sensors"),
    ):
        if key in data:
            return section
    return ""
