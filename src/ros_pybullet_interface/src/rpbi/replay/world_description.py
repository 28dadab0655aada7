"""All that a world was built from, as text by which another process can build the same."""

import hashlib
import json
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pybullet

from custom_ros_tools.errors import ConfigError, Problem
from rpbi.config.loading import LoadedWorld, ObjectConfig
from rpbi.urdf.files import is_temporary, write_description
from rpbi.world import World

from .recorded_values import from_text, to_text

FORMAT = 1
"""Version of the text's layout."""


def describe(world: World) -> str:
    """Returns what a world was built from, and the hash of its state now, at its start, as JSON.

    Files are named with the hashes of their contents; robot descriptions that have no file of their own are in it.
    """
    loaded = world.loaded
    named = _files([item.config.model_dump(mode="json") for item in loaded.objects])
    files = sorted({*named, *(item.path for item in loaded.objects if item.path)})
    return json.dumps(
        {
            "format": FORMAT,
            "pybullet": version("pybullet"),
            "file": loaded.file,
            "config": to_text(loaded.config),
            "objects": [{"type": o.type, "file": o.file, "config": to_text(o.config)} for o in loaded.objects],
            "files": {path: _hash_of(path) for path in files},
            "descriptions": {path: Path(path).read_text(encoding="utf-8") for path in files if is_temporary(path)},
            "start_hash": world.state_hash(),
        },
        indent=1,
    )


class WorldDescription:
    """A description that was read.

    Args:
        text: What `describe` returned.

    Attributes:
        start_hash: Hash of the state at the start.
        warnings: What differs here from where it was written.

    Raises:
        ValueError: If it is none, or one of another version of this package.
    """

    def __init__(self, text: str) -> None:
        try:
            data: dict[str, Any] = json.loads(text)
            if data["format"] != FORMAT:
                raise ValueError(f"the world's description has format {data['format']}, this version reads {FORMAT}")
            self.start_hash: str = data["start_hash"]
            self._file: str = data["file"]
            self._config: str = data["config"]
            self._objects: list[dict[str, str]] = data["objects"]
            self._descriptions: dict[str, str] = data["descriptions"]
            files: dict[str, str] = data["files"]
            written_by: str = data["pybullet"]
        except (json.JSONDecodeError, KeyError, TypeError) as error:
            raise ValueError(f"the world's description cannot be read: {error!r}") from None
        self.warnings = [
            f"{path}: is another file than when the world was recorded"
            for path, digest in files.items()
            if path not in self._descriptions and Path(path).is_file() and _hash_of(path) != digest
        ]
        if written_by != version("pybullet"):
            self.warnings.append(f"recorded with PyBullet {written_by}, replayed with {version('pybullet')}")

    def build(self) -> World:
        """Builds the world, without a window.

        Raises:
            ConfigError: If it cannot be built here, for instance because a file is missing.
        """
        config = from_text(self._config)
        objects = [
            ObjectConfig(each["type"], self._read(each["config"], each["file"]), each["file"]) for each in self._objects
        ]
        return World(LoadedWorld(config, tuple(objects), self._file), connection_mode=pybullet.DIRECT)

    def _read(self, text: str, file: str) -> Any:
        for path, description in self._descriptions.items():
            if path in text:
                text = text.replace(path, write_description(description))
        try:
            return from_text(text)
        except ValueError as error:  # pydantic's are such, too
            raise ConfigError([Problem(file, "", str(error))]) from None


def _files(data: Any) -> Iterator[str]:
    """Yields all names of files in a configuration; validation has made them absolute."""
    if isinstance(data, dict):
        data = list(data.values())
    if isinstance(data, list):
        for item in data:
            yield from _files(item)
    elif isinstance(data, str) and data.startswith("/") and Path(data).is_file():
        yield data


def _hash_of(path: str) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()
