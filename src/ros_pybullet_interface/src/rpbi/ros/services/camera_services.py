"""Adding cameras to a world that runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import rospy

from custom_ros_tools.config import load_config, load_configs
from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.srv import SetString, SetStringRequest, SetStringResponse
from rpbi.config.asset_files import find_file
from rpbi.config.object_entry import FILE, parse_object_entry
from rpbi.config.sensors import RgbdSensorConfig

from .node_services import NO_FOLDER, NodeService

CAMERA_SERVICES: dict[str, NodeService] = {
    "rpbi/add_rgbd_sensor": NodeService(
        SetString, "Adds a camera: the keys of `rgbd_sensor` as YAML text, or `file` and the keys that differ."
    )
}
"""What is served for cameras; `rpbi/remove_pybullet_object` removes them too."""


class CameraServices:
    """Adds cameras.

    Args:
        add: Adds a camera, by configuration and name of its file, and all that belongs to it.
        search_paths: Folders to look for files in.
    """

    def __init__(self, add: Callable[[RgbdSensorConfig, str], None], search_paths: tuple[str, ...]) -> None:
        self._add, self._search_paths = add, search_paths
        (name,) = CAMERA_SERVICES
        rospy.Service(name, SetString, self._add_camera)

    def _add_camera(self, request: SetStringRequest) -> SetStringResponse:
        try:
            data, file = self._read(request.data)
            config = RgbdSensorConfig.parse(data, file)
            self._add(config, file)
        except InterfaceError as error:
            return SetStringResponse(success=False, message=str(error))
        return SetStringResponse(success=True, message=f"added '{config.name}'")

    def _read(self, text: str) -> tuple[Mapping[str, Any], str]:
        """Returns the keys of a camera and what to call where they came from."""
        data = load_configs(text, "data")
        if FILE not in data:
            return data, "data"
        try:
            instance = parse_object_entry(data)
            path = find_file(instance.file, NO_FOLDER, self._search_paths)
        except ValueError as error:
            raise InterfaceError(f"{FILE}: {error}") from None
        return instance.apply_overrides(load_config(path)), instance.file
