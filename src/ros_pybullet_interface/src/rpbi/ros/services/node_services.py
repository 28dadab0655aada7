"""The node's services; a handler never touches PyBullet, it asks the simulation thread."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import rospy
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

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
from rpbi.bodies import BODY_TYPES, kind_of
from rpbi.bodies.collision import CollisionObject
from rpbi.bodies.dynamic import DynamicObject
from rpbi.bodies.robots.robot import Robot
from rpbi.bodies.soft import SoftObject
from rpbi.bodies.urdf_object import UrdfObject
from rpbi.bodies.visual import VisualObject
from rpbi.config.asset_files import find_file
from rpbi.config.loading import load_object, type_of
from rpbi.engine.clock import NS_PER_S
from rpbi.ros.requests import Requests
from rpbi.ros.simulation import Simulation


class NodeService(NamedTuple):
    """What a service of the node is.

    Attributes:
        service_type: Its ROS type.
        meaning: What it does, in a sentence.
    """

    service_type: type
    meaning: str


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


NODE_SERVICES: dict[str, NodeService] = {
    "rpbi/start": NodeService(Trigger, "Lets the world run; `success` is false if it does so already."),
    "rpbi/stop": NodeService(Trigger, "Lets the world stand still; `success` is false if it does so already."),
    "rpbi/step": NodeService(
        Trigger, "Goes one tick on, if the world stands still; the message is `tick N, stamp S` [s]."
    ),
    "rpbi/add_pybullet_object": NodeService(
        AddPybulletObject, "Adds an object from a YAML file or text; the message has all problems of it."
    ),
    "rpbi/remove_pybullet_object": NodeService(SetString, "Removes the object or camera of that name."),
    "rpbi/list_objects": NodeService(ListObjects, "Tells names and types of all objects and cameras."),
}
"""What the node serves, in the order of its handlers."""


class NodeServices:
    """Start, stop, step; add, remove and list objects.

    Args:
        simulation: What to control.
        ask: Reaches the simulation thread.
        add: Adds an object, by type, configuration and name of its file, and all that belongs to it.
        remove: Removes an object, by name, and all that belongs to it.
        context: What reading an object's file needs to know of the world, see `load_object`.
    """

    def __init__(
        self,
        simulation: Simulation,
        ask: Requests,
        add: Callable[[str, Any, str], None],
        remove: Callable[[str], None],
        context: Mapping[str, Any],
    ) -> None:
        self._simulation, self._ask, self._add, self._remove = simulation, ask, add, remove
        self._context = context
        handlers = (self._start, self._stop, self._step, self._add_object, self._remove_object, self._list_objects)
        for (name, service), handler in zip(NODE_SERVICES.items(), handlers, strict=True):
            rospy.Service(name, service.service_type, handler)

    def _start(self, _: TriggerRequest) -> TriggerResponse:
        return self._switch(self._simulation.start, "started", "already running")

    def _stop(self, _: TriggerRequest) -> TriggerResponse:
        return self._switch(self._simulation.stop, "stopped", "already stopped")

    def _switch(self, switch: Callable[[], bool], done: str, refused: str) -> TriggerResponse:
        try:
            changed = self._ask(switch)
        except InterfaceError as error:
            return TriggerResponse(success=False, message=str(error))
        return TriggerResponse(success=changed, message=done if changed else refused)

    def _step(self, _: TriggerRequest) -> TriggerResponse:
        try:
            tick, stamp_ns = self._ask(self._simulation.step)
        except InterfaceError as error:
            return TriggerResponse(success=False, message=str(error))
        seconds, nanoseconds = divmod(stamp_ns, NS_PER_S)
        return TriggerResponse(success=True, message=f"tick {tick}, stamp {seconds}.{nanoseconds:09d}")

    def _add_object(self, request: AddPybulletObjectRequest) -> AddPybulletObjectResponse:
        asked = request.pybullet_object
        try:
            section = OBJECT_TYPES.get(asked.object_type)
            if section is None:
                known = ", ".join(f"{number} ({name})" for number, name in OBJECT_TYPES.items())
                raise InterfaceError(f"object_type: expected one of {known}; got {asked.object_type}")
            data, file, path = self._read(asked)
            kind = type_of(section, data, BODY_TYPES)
            config = load_object(kind, data, file, BODY_TYPES, {**self._context, "file": path})
            self._add(kind, config, file)
        except InterfaceError as error:
            return AddPybulletObjectResponse(success=False, message=str(error))
        except Exception as error:  # nothing that an object brings along may leave the caller without an answer
            log.exception("adding an object failed in a way that is not foreseen")
            return AddPybulletObjectResponse(success=False, message=f"{type(error).__name__}: {error}")
        return AddPybulletObjectResponse(success=True, message=f"added '{config.name}'")

    def _read(self, asked: PybulletObject) -> tuple[dict[str, Any], str, str]:
        """Returns an object's YAML, what to call its file in messages, and beside what its own files are looked for.

        The caller's working directory is unknown here: what has no folder, such as a text, is looked for in the
        world's search paths and PyBullet's data only.
        """
        if asked.filename:
            try:
                path = find_file(asked.filename, NO_FOLDER, self._context["search_paths"])
            except ValueError as error:
                raise InterfaceError(f"filename: {error}") from None
            return load_config(path), asked.filename, path
        if asked.config:
            return load_configs(asked.config, "config"), "config", NO_FOLDER
        raise InterfaceError("expected a filename or a config; got neither")

    def _remove_object(self, request: SetStringRequest) -> SetStringResponse:
        try:
            self._remove(request.data)
        except InterfaceError as error:
            return SetStringResponse(success=False, message=str(error))
        return SetStringResponse(success=True, message=f"removed '{request.data}'")

    def _list_objects(self, _: ListObjectsRequest) -> ListObjectsResponse:
        world = self._simulation.world
        bodies, cameras = self._ask.or_service_error(lambda: (dict(world.bodies), list(world.cameras)))
        types = [kind_of(body) for body in bodies.values()] + ["rgbd_sensor"] * len(cameras)
        return ListObjectsResponse(names=[*bodies, *cameras], types=types)
