"""Recognises the kind of a file by its keys, to report a file that is named where another kind belongs."""

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
"""Lists of the main file that name objects and cameras, with the kind of file that each takes."""
_OF_WORLDS = ("timeStep", "setGravity", "setPhysicsEngineParameter", "connect", *_SECTIONS)
_OF_ROBOTS = ("setJointMotorControlArray", "setJointMotorControlArrayParameters", "is_visual_robot")
_XML = {"robot": "a URDF", "launch": "a launch file", "sdf": "an SDF file", "mujoco": "an MJCF file"}
"""Kinds of XML files by the element at the top."""


def load_main_file(path: str) -> dict[str, Any]:
    """Returns the content of the main file of a world.

    Raises:
        ConfigError: If it is not a YAML mapping, or is an object's file.
    """
    return _load(path, "a world")


def load_object_file(path: str) -> dict[str, Any]:
    """Returns the content of an object's file.

    Raises:
        ConfigError: If it is not a YAML mapping; a URDF is reported as such.
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
    """Returns the kind of an XML file, empty if it is none of those known."""
    with suppress(ConfigError, OSError, UnicodeDecodeError):
        text = read_file(replace_package(path), MAX_BYTES).decode().lstrip()
        if text.startswith("<"):
            first = [(text.find(f"<{tag}"), kind) for tag, kind in _XML.items() if f"<{tag}" in text]
            return min(first)[1] if first else ""
    return ""


def check_is_world(data: Mapping[str, Any], file: str) -> None:
    """Checks that the content of a main file is not that of an object.

    Raises:
        ConfigError: If it is; it says where to list the file.
    """
    section = _section_of(data)
    if section and not any(key in data for key in _OF_WORLDS):
        message = f"is an object file ({_SECTIONS[section][2:]}), not a world: list it under {section} of a world"
        raise ConfigError([Problem(file, "", f"{message}, see docs/worlds.md")])


def check_is_listed_right(data: Mapping[str, Any], file: str, section: str, known: Collection[str]) -> None:
    """Checks that an object's file is in the list for its kind.

    Args:
        data: Its content.
        file: Its name.
        section: The list that names it.
        known: Keys that objects of this list may have.

    Raises:
        ConfigError: If it is of another kind; it names the right list.
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
    """Returns the list in which a file belongs by its keys; empty if they do not decide it."""
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
