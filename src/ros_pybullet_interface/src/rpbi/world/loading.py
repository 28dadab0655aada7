"""Reads the main YAML file of a world and all files that it names, and reports all of their problems at once."""

import contextlib
import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

from custom_ros_tools.config import replace_package
from custom_ros_tools.errors import ConfigError, Problem, UnknownNameError
from robot_model.asset_files import ROBOT_DESCRIPTION, find_file, find_folder
from robot_model.geometry import Pose
from robot_model.urdf.for_ros import joined_for_ros
from rpbi.bodies.file_checks import file_problems, parts_with_files
from rpbi.bodies.robots.robot_config import RobotConfig
from rpbi.config.object_entry import ObjectEntry, parse_object_entry
from rpbi.config.sensors import FIRST_TOPIC_NAME, RgbdSensorConfig
from rpbi.config.world import WorldConfig, main_file_model

from .file_kinds import check_is_world, load_main_file, load_object_file
from .legacy import MAIN
from .objects import ObjectConfig, load_object, name_in, object_sections, parse_section, type_of

__all__ = [
    "LoadedWorld",
    "ObjectConfig",
    "WorldConfig",
    "load_object",
    "load_world",
    "load_world_dict",
    "robots_description",
    "type_of",
]

log = logging.getLogger(__name__)

CAMERAS = "rgbd_sensors"
"""Key of the main file whose value lists the files of further cameras."""


class CameraConfig(NamedTuple):
    """Configuration of a camera of a world, and the name of the configuration file.

    Attributes:
        config: Configuration of the camera.
        file: Name of the configuration file, as the user wrote the name.
    """

    config: RgbdSensorConfig
    file: str


@dataclass(frozen=True)
class LoadedWorld:
    """The validated configuration of a world; picklable.

    Attributes:
        config: Configuration from the main file.
        objects: Configurations of the objects, in the order of loading.
        cameras: Configurations of the cameras: first the camera under the key `rgbd_sensor`, if there is one, then the
            cameras listed under `rgbd_sensors`, in the order of their list.
        file: Name of the main file; `"~config"` if its content came from the parameter server.
    """

    config: WorldConfig
    objects: tuple[ObjectConfig, ...]
    file: str
    cameras: tuple[CameraConfig, ...] = ()


def load_world(
    path: str, robot_description: str | None = None, overrides: Mapping[str, Any] = MappingProxyType({})
) -> LoadedWorld:
    """Reads a main YAML file and all files that it names.

    Args:
        path: The main file; `{package}/path` and `package://package/path` are resolved.
        robot_description: URDF file to load wherever a configuration gives `robot_description` as the file name; None
            if no URDF is supplied.
        overrides: Values that replace values of the main file, indexed by key. Mappings are merged key by key.

    Raises:
        ConfigError: If there are problems; the error lists all problems of all files.
    """
    data = ObjectEntry(path, overrides).apply_overrides(load_main_file(path))
    return _Reader(data, path, replace_package(path), robot_description).read()


def load_world_dict(data: Mapping[str, Any], file: str, robot_description: str | None = None) -> LoadedWorld:
    """Reads a world as `load_world` does, but from the content of a main file that was read already.

    Args:
        data: Content of the main file; it is not changed.
        file: Name of the main file, or `"~config"` if the content came from the parameter server.
        robot_description: See `load_world`.

    Raises:
        ConfigError: If there are problems; the error lists all problems of all files.
    """
    return _Reader(data, file, file, robot_description).read()


def robots_description(path: str, names: Sequence[str]) -> str:
    """Returns the text of a single URDF that contains the named robots of a world, with their bases at the start poses.

    The URDF's root is the link `world`. Names of links and joints begin with the robot's name and an underscore.

    Args:
        path: The world's main file.
        names: Names of the robots.

    Raises:
        ConfigError: If the world cannot be loaded.
        UnknownNameError: If the world does not have a robot with a given name.
    """
    configs = (each.config for each in load_world(path).objects)
    bases = {each.name: each.loadURDF for each in configs if isinstance(each, RobotConfig)}
    origin, robots = Pose(), {}
    for name in names:
        if name not in bases:
            raise UnknownNameError("robot", name, bases)
        base = bases[name]
        pose = Pose(base.basePosition or origin.position, base.baseOrientation or origin.quat_xyzw)
        robots[name] = base.fileName, pose
    return joined_for_ros(robots)


class _Reader:
    """Reads one world and collects the problems of its files."""

    def __init__(self, data: Mapping[str, Any], file: str, path: str, robot_description: str | None) -> None:
        self._data = data
        self._file = file
        self._path = path
        self._robot_description = robot_description
        self._problems: list[Problem] = []
        self._owner_of: dict[str, str] = {}
        self._parts: list[tuple[str, Mapping[str, Any]]] = []
        """Pairs of an object's file and the parts of its configuration that may name further files."""

    def read(self) -> LoadedWorld:
        """Reads all files and returns the configuration of the world.

        Raises:
            ConfigError: If there are problems; the error lists all of them.
        """
        if isinstance(self._data, Mapping):
            check_is_world(self._data, self._file)
        try:
            model = main_file_model(object_sections())
            content = parse_section(MAIN, self._data, self._file, model, {"file": self._path})
        except ConfigError as error:
            self._problems += error.problems
        objects = tuple(self._objects()) if isinstance(self._data, Mapping) else ()
        further_cameras = tuple(self._further_cameras()) if isinstance(self._data, Mapping) else ()
        if self._problems:
            # If there were no problems so far, problems of these files would be reported when the world is built
            for file, parts in self._parts:
                self._problems += [Problem(file, key, message) for key, message in file_problems(parts)]
            raise ConfigError(self._problems)
        config = WorldConfig.from_main_file(content)
        first_camera = () if config.rgbd_sensor is None else (CameraConfig(config.rgbd_sensor, self._file),)
        if config.step_pybullet_manually:
            log.info("%s: step_pybullet_manually: has no effect: every step is explicit", self._file)
        return LoadedWorld(config, objects, self._file, first_camera + further_cameras)

    def _objects(self) -> Iterator[ObjectConfig]:
        for section in object_sections():
            for data, file, context in self._files(section):
                with self._noting_problems(file):
                    self._parts.append((file, parts_with_files(data, file, context)))
                    kind = type_of(section, data)
                    yield ObjectConfig(kind, load_object(kind, data, file, context), file, context["file"])
        self._claim_name(self._data.get("rgbd_sensor"), self._file, "rgbd_sensor.name")

    def _further_cameras(self) -> Iterator[CameraConfig]:
        is_first = self._data.get("rgbd_sensor") is None
        for data, file, _ in self._files(CAMERAS):
            if not is_first and name_in(data) == FIRST_TOPIC_NAME:
                message = f"topics of the first camera are named '{FIRST_TOPIC_NAME}'; use another name"
                self._problems.append(Problem(file, "name", message))
            is_first = False
            with self._noting_problems(file):
                yield CameraConfig(RgbdSensorConfig.parse(data, file), file)

    def _files(self, section: str) -> Iterator[tuple[dict[str, Any], str, dict[str, Any]]]:
        """Reads the files in the list `section` of the main file.

        Yields the content of each file, the file's name for messages, and the argument `context` for `load_object`.
        Collects a problem for each file that cannot be read, and for each object name that is not unique.
        """
        search_paths = self._search_paths()
        for index, entry in _object_entries(self._data.get(section)):
            key = f"{section}[{index}]"
            try:
                path = find_file(entry.file, self._path, search_paths)
            except ValueError as error:
                self._problems.append(Problem(self._file, key, str(error)))
                continue
            file = f"{entry.file} (changed by {key})" if entry.overrides else entry.file
            with self._noting_problems(file):
                data = entry.apply_overrides(load_object_file(path))
                self._claim_name(data, file, "name")
                context = {"file": path, "search_paths": search_paths, ROBOT_DESCRIPTION: self._robot_description}
                yield data, file, context

    @contextlib.contextmanager
    def _noting_problems(self, file: str) -> Iterator[None]:
        try:
            yield
        except ConfigError as error:
            self._problems += [Problem(file, problem.key, problem.message) for problem in error.problems]

    def _claim_name(self, data: Any, file: str, key: str) -> None:
        """Registers the name of an object, or collects a problem if another object has the same name."""
        name = name_in(data)
        if name in self._owner_of:
            message = f"'{name}' is taken by {self._owner_of[name]}; names are unique in a world"
            self._problems.append(Problem(file, key, message))
        elif name is not None:
            self._owner_of[name] = file

    def _search_paths(self) -> tuple[str, ...]:
        """Returns the configured search paths that exist, without checking other keys of the main file."""
        given = self._data.get("setAdditionalSearchPath")
        folders: list[str] = []
        for name in [given] if isinstance(given, str) else given if isinstance(given, (list, tuple)) else ():
            with contextlib.suppress(ValueError):  # reported with the main file
                folders += [find_folder(name, self._path)] if isinstance(name, str) and name else []
        return tuple(folders)


def _object_entries(given: Any) -> Iterator[tuple[int, ObjectEntry]]:
    """Yields the index and content of each valid entry of a list; the main file's model reports invalid ones."""
    for index, entry in enumerate(given if isinstance(given, (list, tuple)) else ()):
        with contextlib.suppress(ValueError):
            yield index, parse_object_entry(entry)
