"""All that a world was built from, as text by which another process can build the same."""

import hashlib
import json
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

from custom_ros_tools.config import read_file
from custom_ros_tools.errors import ConfigError, Problem, shortened
from custom_ros_tools.plugins import full_name
from custom_ros_tools.schema import ConfigModel
from custom_ros_tools.schema.type_names import shown
from robot_model.asset_files import LONGEST_PATH
from robot_model.urdf.files import is_temporary, write_description
from rpbi.bodies import BodyConfig
from rpbi.config.sensors import RgbdSensorConfig
from rpbi.world.loading import CameraConfig, LoadedWorld, ObjectConfig, WorldConfig

from .values import from_text, to_text

FORMAT = 1
"""Version of the text's layout."""


def describe(loaded: LoadedWorld, start_hash: str) -> str:
    """Returns what a world was built from, and the hash of its state at its start, as JSON.

    Files are named with the hashes of their contents; robot descriptions that have no file of their own are in it.
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
    """An object of a description, with its configuration as text."""

    type: str
    file: str
    config: str


class _Camera(ConfigModel):
    """A camera of a description, with its configuration as text."""

    file: str
    config: str


class _Description(ConfigModel):
    """Content that `describe` writes, without the format. Older recordings have no cameras."""

    pybullet: str
    file: str
    config: str
    objects: list[_Object]
    cameras: list[_Camera] = []
    files: dict[str, str]
    descriptions: dict[str, str]
    start_hash: str


class WorldDescription:
    """A description that was read.

    Args:
        text: Result of `describe`.

    Attributes:
        start_hash: Hash of the state at the start.
        warnings: Differences of this machine from the recording one.

    Raises:
        ValueError: If the text is no description, or one of another version of this package.
    """

    def __init__(self, text: str) -> None:
        try:
            data = json.loads(text)
            if data["format"] != FORMAT:
                raise ValueError(f"the world's description has format {data['format']}, this version reads {FORMAT}")
            described = {key: value for key, value in data.items() if key != "format"}
            read = _Description.parse(described, "")
        except ConfigError as error:
            raise ValueError(f"the world's description cannot be read: {error.problems[0]}") from None
        except (json.JSONDecodeError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise ValueError(f"the world's description cannot be read: {shortened(repr(error))}") from None
        self.start_hash = read.start_hash
        self._file, self._config = read.file, read.config
        self._objects, self._cameras = read.objects, read.cameras
        self._descriptions, written_by = read.descriptions, read.pybullet
        self.warnings = [
            f"{path}: is another file than when the world was recorded"
            for path, digest in read.files.items()
            if path not in self._descriptions and _has_changed(path, digest)
        ]
        if written_by != version("pybullet"):
            self.warnings.append(f"recorded with PyBullet {written_by}, replayed with {version('pybullet')}")

    def load(self) -> LoadedWorld:
        """Returns the configuration of the world.

        Raises:
            ConfigError: If it is not valid here, for instance because a file is missing.
        """
        config = self._read(self._config, self._file, WorldConfig)
        objects = [ObjectConfig(each.type, self._read(each.config, each.file), each.file) for each in self._objects]
        cameras = [
            CameraConfig(self._read(each.config, each.file, RgbdSensorConfig), each.file) for each in self._cameras
        ]
        return LoadedWorld(config, tuple(objects), self._file, tuple(cameras))

    def _read(self, text: str, file: str, kind: type[ConfigModel] = BodyConfig) -> Any:
        for path, description in self._descriptions.items():
            if path in text:
                text = text.replace(path, write_description(description))
        try:
            config = from_text(text)
            if not isinstance(config, kind):
                raise ValueError(f"expected a {full_name(kind)}, got {shown(config)}")
            return config
        except ValueError as error:  # pydantic's are such, too
            raise ConfigError([Problem(file, "", str(error))]) from None


def _files(data: Any) -> Iterator[str]:
    """Yields all names of files in a configuration; validation has made them absolute."""
    if isinstance(data, dict):
        data = list(data.values())
    if isinstance(data, list):
        for item in data:
            yield from _files(item)
    elif isinstance(data, str) and data.startswith("/") and len(data) < LONGEST_PATH and Path(data).is_file():
        yield data


def _hash_of(path: str) -> str:
    return hashlib.sha256(read_file(path)).hexdigest()


def _has_changed(path: str, digest: str) -> bool:
    try:
        return Path(path).is_file() and _hash_of(path) != digest
    except OSError:  # building the world tells what is wrong with it
        return False
