"""The services that add, remove and list objects and cameras."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Any

from custom_ros_tools.config import load_config, load_configs
from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.srv import SetString, SetStringRequest, SetStringResponse
from ros_pybullet_interface.msg import PybulletObject
from ros_pybullet_interface.srv import (
    AddPybulletObject,
    AddPybulletObjectRequest,
    AddPybulletObjectResponse,
    ListObjects,
    ListObjectsRequest,
    ListObjectsResponse,
)
from rpbi.bodies import BODY_TYPES, CollisionObject, DynamicObject, Robot, SoftObject, UrdfObject, VisualObject, kind_of
from rpbi.config.asset_files import find_file
from rpbi.config.loading import load_object, type_of
from rpbi.config.object_entry import FILE, parse_object_entry
from rpbi.config.sensors import RgbdSensorConfig
from rpbi.ros.endpoints import Service

from .node_context import NodeContext

log = logging.getLogger(__name__)

NO_FOLDER = "~config"
"""Stands for the path of a YAML that came without one."""
OBJECT_TYPES = {
    PybulletObject.VISUAL: VisualObject.section,
    PybulletObject.COLLISION: CollisionObject.section,
    PybulletObject.DYNAMIC: DynamicObject.section,
    PybulletObject.ROBOT: Robot.section,
    PybulletObject.SOFT: SoftObject.section,
    PybulletObject.URDF: UrdfObject.section,
}
"""List of the main file for each number in PybulletObject."""


def _add_object(node: NodeContext, request: AddPybulletObjectRequest) -> AddPybulletObjectResponse:
    asked = request.pybullet_object
    try:
        section = OBJECT_TYPES.get(asked.object_type)
        if section is None:
            known = ", ".join(f"{number} ({name})" for number, name in OBJECT_TYPES.items())
            raise InterfaceError(f"object_type: expected one of {known}; got {asked.object_type}")
        data, file, path = _read_object(node, asked)
        kind = type_of(section, data, BODY_TYPES)
        config = load_object(kind, data, file, BODY_TYPES, {**node.loading, "file": path})
        node.objects.add(kind, config, file)
    except InterfaceError:
        raise
    except Exception as error:  # nothing that an object brings along may leave the caller without an answer
        log.exception("adding an object failed in a way that is not foreseen")
        return AddPybulletObjectResponse(False, f"{type(error).__name__}: {error}")
    return AddPybulletObjectResponse(True, f"added '{config.name}'")


def _read_object(node: NodeContext, asked: PybulletObject) -> tuple[dict[str, Any], str, str]:
    """Returns an object's YAML, what to call its file in messages, and beside what its own files are looked for.

    The caller's working directory is unknown here: what has no folder, such as a text, is looked for in the world's
    search paths and PyBullet's data only.
    """
    if asked.filename:
        path = _find(node, asked.filename, "filename")
        return load_config(path), asked.filename, path
    if asked.config:
        return load_configs(asked.config, "config"), "config", NO_FOLDER
    raise InterfaceError("expected a filename or a config; got neither")


def _add_camera(node: NodeContext, request: SetStringRequest) -> SetStringResponse:
    data, file = _read_camera(node, request.data)
    config = RgbdSensorConfig.parse(data, file)
    node.objects.add_camera(config, file)
    return SetStringResponse(True, f"added '{config.name}'")


def _read_camera(node: NodeContext, text: str) -> tuple[Mapping[str, Any], str]:
    """Returns the keys of a camera and what to call where they came from."""
    data = load_configs(text, "data")
    if FILE not in data:
        return data, "data"
    try:
        entry = parse_object_entry(data)
    except ValueError as error:
        raise InterfaceError(f"{FILE}: {error}") from None
    return entry.apply_overrides(load_config(_find(node, entry.file, FILE))), entry.file


def _find(node: NodeContext, name: str, key: str) -> str:
    """Returns the path of the file that a key names."""
    try:
        return find_file(name, NO_FOLDER, node.loading["search_paths"])
    except ValueError as error:
        raise InterfaceError(f"{key}: {error}") from None


def _remove_object(node: NodeContext, request: SetStringRequest) -> SetStringResponse:
    node.objects.remove(request.data)
    return SetStringResponse(True, f"removed '{request.data}'")


def _list_objects(node: NodeContext, _: ListObjectsRequest) -> ListObjectsResponse:
    world = node.simulation.world
    bodies, cameras = node.ask(lambda: (dict(world.bodies), list(world.cameras)))
    types = [kind_of(body) for body in bodies.values()] + ["rgbd_sensor"] * len(cameras)
    return ListObjectsResponse([*bodies, *cameras], types)


OBJECT_SERVICES = (
    Service(
        "rpbi/add_pybullet_object",
        AddPybulletObject,
        _add_object,
        "Adds an object from a YAML file or text; the message has all problems of it.",
    ),
    Service(
        "rpbi/add_rgbd_sensor",
        SetString,
        _add_camera,
        "Adds a camera: the keys of `rgbd_sensor` as YAML text, or `file` and the keys that differ.",
    ),
    Service("rpbi/remove_pybullet_object", SetString, _remove_object, "Removes the object or camera of that name."),
    Service("rpbi/list_objects", ListObjects, _list_objects, "Returns names and types of all objects and cameras."),
)
