"""Descriptions of worlds: texts from which another process can build the same world."""

import hashlib
import json
import re
from collections.abc import Collection, Iterator
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

from custom_ros_tools.config import read_file
from custom_ros_tools.errors import ConfigError, Problem, shortened
from custom_ros_tools.foreign import load_foreign_json, printable
from custom_ros_tools.plugins import full_name
from custom_ros_tools.schema import ConfigModel
from custom_ros_tools.schema.type_names import shown
from robot_model.asset_files import LONGEST_PATH
from robot_model.urdf.files import is_temporary, write_description
from rpbi.bodies import BODY_TYPES, BodyConfig
from rpbi.config.sensors import RgbdSensorConfig
from rpbi.world.loading import CameraConfig, LoadedWorld, ObjectConfig, WorldConfig

from .values import from_text, to_text, trusting

FORMAT = 1
"""Version of the layout of descriptions."""
MAX_COMPARED_BYTES = 1 << 30
"""Total size of the files that are compared with the recorded hashes [bytes]; files beyond this size are skipped."""
_WRITTEN = re.compile(r'(?<=")/[^"\\]*/robot_description-[0-9a-f]{12}\.urdf(?=")')
"""Pattern of a path in JSON to a file that `write_description` wrote."""


def describe(loaded: LoadedWorld, start_hash: str) -> str:
    """Returns the JSON description of a world: the configuration, and hashes of all files and of the start state.

    Files are not included, except robot descriptions that `write_description` wrote to temporary files.

    Args:
        loaded: Configuration of the world.
        start_hash: Hash of the state after the world was built, see `World.state_hash`.
    """
    named = _files([item.config.model_dump(mode="json") for item in loaded.objects])
    files = sorted({*named, *(item.path for item in loaded.objects if item.path)})
    return json.dumps(
        {
            "format": FORMAT,
            "pybullet": version("pybullet"),
            "file": loaded.file,
            "config": to_text(loaded.config),
            "objects": [{"type": o.type, "file": o.file, "config": to_text(o.config)} for o in loaded.objects],
            "cameras": [{"file": camera.file, "config": to_text(camera.config)} for camera in loaded.cameras],
            "files": {path: _hash_of(path) for path in files},
            "descriptions": {path: Path(path).read_text(encoding="utf-8") for path in files if is_temporary(path)},
            "start_hash": start_hash,
        },
        indent=1,
    )


class _Object(ConfigModel):
    """An object in the description of a saved world; `config` is the object's configuration as text from `to_text`."""

    type: str
    file: str
    config: str


class _Camera(ConfigModel):
    """A camera in the description of a saved world; `config` is the camera's configuration as text from `to_text`."""

    file: str
    config: str


class _Description(ConfigModel):
    """Content of a world's description, without the key `format`. Older recordings lack the key `cameras`."""

    pybullet: str
    file: str
    config: str
    objects: list[_Object]
    cameras: list[_Camera] = []
    files: dict[str, str]
    descriptions: dict[str, str]
    start_hash: str


class WorldDescription:
    """A description of a world, which was read from its text.

    Args:
        text: Description that `describe` returned.

    Attributes:
        start_hash: Hash of the world's state after it was built.

    Raises:
        ValueError: If the text is not a description, or was written by an incompatible version of this package.
    """

    def __init__(self, text: str) -> None:
        try:
            data = load_foreign_json(text, "")
            if data["format"] != FORMAT:
                given = shortened(repr(data["format"]))
                raise ValueError(f"the world's description has format {given}, this version reads {FORMAT}")
            described = {key: value for key, value in data.items() if key != "format"}
            read = _Description.parse(described, "")
        except ConfigError as error:
            raise ValueError(f"the world's description cannot be read: {error.problems[0]}") from None
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"the world's description cannot be read: {shortened(repr(error))}") from None
        if wrong := [path for path in read.descriptions if not _WRITTEN.search(json.dumps(path))]:
            raise ValueError(f"the world's description has a text for '{shortened(printable(wrong[0]))}'")
        self.start_hash = read.start_hash
        self._read = read

    @cached_property
    def warnings(self) -> list[str]:
        """A message for each recorded file that differs on this machine, and one if PyBullet's version differs."""
        read, left, differences = self._read, MAX_COMPARED_BYTES, []
        for path, digest in read.files.items():
            if path in read.descriptions:
                continue
            try:
                data = read_file(path, left)
            except OSError:  # building the world reports a missing file
                continue
            left -= len(data)
            if hashlib.sha256(data).hexdigest() != digest:
                differences.append(f"{printable(path)}: is another file than when the world was recorded")
        if read.pybullet != version("pybullet"):
            differences.append(
                f"recorded with PyBullet {printable(read.pybullet, 50)}, replayed with {version('pybullet')}"
            )
        return differences

    def load(self, trust: Collection[str] | None = ()) -> LoadedWorld:
        """Returns the configuration of the world.

        Args:
            trust: Packages from which the description may import classes, see `trusting`.

        Raises:
            ConfigError: If the configuration is not valid on this machine, for instance because a file is missing.
        """
        read = self._read
        with trusting(trust):
            config = self._parse(read.config, read.file, WorldConfig)
            for each in read.objects:
                BODY_TYPES.configured(each.type, printable(each.file), "type")
            objects = [ObjectConfig(each.type, self._parse(each.config, each.file), each.file) for each in read.objects]
            cameras = [
                CameraConfig(self._parse(each.config, each.file, RgbdSensorConfig), each.file) for each in read.cameras
            ]
        return LoadedWorld(config, tuple(objects), printable(read.file), tuple(cameras))

    def _parse(self, text: str, file: str, kind: type[ConfigModel] = BodyConfig) -> Any:
        descriptions = self._read.descriptions

        def here(path: re.Match[str]) -> str:
            return write_description(descriptions[path[0]]) if path[0] in descriptions else path[0]

        try:
            config = from_text(_WRITTEN.sub(here, text))
            if not isinstance(config, kind):
                raise ValueError(f"expected a {full_name(kind)}, got {shown(config)}")
            return config
        except ConfigError as error:
            raise ConfigError([Problem(printable(file), each.key, each.message) for each in error.problems]) from None
        except ValueError as error:
            raise ConfigError([Problem(printable(file), "", str(error))]) from None


def _files(data: Any) -> Iterator[str]:
    """Yields the paths of existing files in a configuration; validation has made all paths absolute."""
    if isinstance(data, dict):
        data = list(data.values())
    if isinstance(data, list):
        for item in data:
            yield from _files(item)
    elif isinstance(data, str) and data.startswith("/") and len(data) < LONGEST_PATH and Path(data).is_file():
        yield data


def _hash_of(path: str) -> str:
    return hashlib.sha256(read_file(path)).hexdigest()
