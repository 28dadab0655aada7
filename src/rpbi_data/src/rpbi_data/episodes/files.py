"""Stores copies of the files named in a world's description, and changes the description to use these copies."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr, unescape

from custom_ros_tools.config import load_config, read_file, ros_packages
from custom_ros_tools.errors import ConfigError, Problem
from custom_ros_tools.files import atomic_file
from custom_ros_tools.foreign import MAX_PATH_BYTES, load_foreign_json, path_below, printable, read_below
from robot_model.asset_files import ASSETS, pybullet_data, resolve_package
from robot_model.urdf.document import UrdfDocument
from robot_model.urdf.files import found_mesh, write_description

from .errors import EpisodeError
from .facts import MAX_FILES, MAX_LABEL

URDF = ".urdf"
MAX_FILE_BYTES = 2**29
"""Largest size of a file that is stored with an episode [bytes]."""
MAX_ALL_BYTES = 2**31
"""Largest total size of the files of an episode [bytes]."""
_NAMED = 5
"""Largest number of files that a message about missing copies names. Further files are only counted."""


def store_files(
    description: str, store: Path, is_own: Callable[[Path], bool] = lambda _: True
) -> tuple[list[dict[str, Any]], list[str]]:
    """Copies the files that a world's description names, and the meshes of its URDFs, into a folder.

    Args:
        description: The world's description as JSON, as on the topic `rpbi/world_description`.
        store: The folder. The name of a copy is `HASH.EXTENSION`. Existing copies are kept.
        is_own: Function that returns whether a file may be copied, see `files_of_world`. The argument is the file's
            path, with symbolic links resolved.

    Returns:
        A dictionary for each file, and messages. A dictionary has the keys `path` and `sha256`, and for a URDF also
        `meshes`, which maps mesh names in the URDF to paths. The messages are about files that cannot be read, are not
        copied, or have changed since the world was loaded.

    Raises:
        ConfigError: If `description` is not the description of a world.
    """
    data = _described(description)
    copies = _Copies(store, is_own)
    for path, expected in data["files"].items():
        if not _is_plain(path):
            copies.faults.append(f"not copied: expected the absolute path of a file, got {printable(path, MAX_LABEL)}")
            continue
        if path in data["descriptions"]:
            copies.add_meshes(path, write_description(data["descriptions"][path]))
            continue
        digest = copies.add(path)
        if digest not in ("", expected):
            copies.faults.append(f"{path} has changed since the world was loaded")
        if digest and path.lower().endswith(URDF):
            copies.add_meshes(path, path)
    return list(copies.stored.values()), copies.all_faults


def files_of_world(description: str, further: Iterable[Path] = ()) -> Callable[[Path], bool]:
    """Returns a function that decides whether a file may belong to a world with an untrusted description.

    The function allows files in ROS packages, in installed robot data, in the folder of the world's main file, and in
    further folders. The folder of the main file is only included if the file has the keys of a main file. Hidden files
    and files in hidden folders are only allowed in further folders.

    Args:
        description: The world's description as JSON.
        further: Further folders.

    Raises:
        ConfigError: If `description` is not the description of a world.
    """
    main = _described(description).get("file")
    folders = [*_package_folders(), *([Path(main).parent] if isinstance(main, str) and _is_main_file(main) else ())]
    own, all_of = ([Path(os.path.realpath(each)) for each in group] for group in (folders, further))

    def is_own(path: Path) -> bool:
        if any(path.is_relative_to(folder) for folder in all_of):
            return True
        inner = [path.relative_to(folder).parts for folder in own if path.is_relative_to(folder)]
        return any(not any(part.startswith(".") for part in parts) for parts in inner)

    return is_own


class _Copies:
    """Copies the files of one world, and collects the results of `store_files`."""

    def __init__(self, store: Path, is_own: Callable[[Path], bool]) -> None:
        self.stored: dict[str, dict[str, Any]] = {}
        self.faults: list[str] = []
        self._store, self._left = store, MAX_ALL_BYTES
        self._is_own = is_own
        self._foreign: list[str] = []

    @property
    def all_faults(self) -> list[str]:
        """All messages, including a message about files that must not be copied."""
        if not self._foreign:
            return self.faults
        more = f" and {len(self._foreign) - _NAMED} more" if len(self._foreign) > _NAMED else ""
        names = ", ".join(self._foreign[:_NAMED])
        return [*self.faults, f"not copied, since they are in no folder of the world or of copy_from: {names}{more}"]

    def add(self, path: str) -> str:
        """Copies a file, and returns the file's SHA-256; empty if the file cannot be read or must not be copied."""
        if path in self.stored:
            return str(self.stored[path]["sha256"])
        if not _is_plain(path) or not self._is_own(Path(os.path.realpath(path))):
            self._foreign.append(printable(path, 200))
            return ""
        try:
            if len(self.stored) >= MAX_FILES:
                raise OSError(0, f"expected at most {MAX_FILES} files in all")
            data = read_file(path, min(MAX_FILE_BYTES, self._left))
        except OSError as error:
            self.faults.append(f"{path} cannot be read: {error.strerror or error}")
            return ""
        self._left -= len(data)
        digest = hashlib.sha256(data).hexdigest()
        target = stored_path(self._store, path, digest)
        if not target.exists():
            self._store.mkdir(parents=True, exist_ok=True)
            with atomic_file(target) as part:
                part.write_bytes(data)
        self.stored[path] = {"path": path, "sha256": digest}
        return digest

    def add_meshes(self, urdf: str, source: str) -> None:
        """Copies the meshes of a URDF.

        Args:
            urdf: Path of the URDF in the world's description. Relative mesh names are relative to the URDF's folder.
            source: Path of the file from which the URDF is read.
        """
        meshes: dict[str, str] = {}
        try:
            document = UrdfDocument(urdf, source)
        except ConfigError as error:
            self.faults.append("; ".join(map(str, error.problems)))
            return
        for name in document.meshes:
            try:
                found = found_mesh(name, Path(urdf))
            except (ConfigError, OSError):  # the world was loaded without this mesh
                continue
            path = str(found.resolve() if ".." in found.parts else found.absolute())
            if self.add(path):
                meshes[name] = path
        if urdf in self.stored or len(self.stored) < MAX_FILES:
            self.stored.setdefault(urdf, {"path": urdf, "sha256": ""})["meshes"] = meshes


def _is_plain(path: str) -> bool:
    """Returns whether a path is absolute, without `..`, and can be stored in `episode.yaml`."""
    return path.startswith("/") and ".." not in path.split("/") and printable(path, MAX_PATH_BYTES) == path


def _described(description: str) -> dict[str, Any]:
    """Parses a world's description, and returns the parsed data.

    Raises:
        ConfigError: If an entry for files or configurations is missing or not text.
    """
    data = load_foreign_json(description, "rpbi/world_description")
    try:
        texts = [*data["files"].items(), *data["descriptions"].items()]
        configs = [data["config"], *(each["config"] for each in data["objects"])]
        is_valid = all(isinstance(each, str) for each in (*configs, *(text for pair in texts for text in pair)))
    except (AttributeError, KeyError, TypeError):
        is_valid = False
    if not is_valid:
        raise ConfigError([Problem("rpbi/world_description", "", "expected the description of a world")])
    return dict(data)


@lru_cache(maxsize=1)
def _package_folders() -> tuple[Path, ...]:
    """Returns the folders of all ROS packages, of example-robot-data and of PyBullet's data."""
    packages = ros_packages()
    folders = [*(packages.get_path(name) for name in packages.list()), *pybullet_data()]
    with suppress(ValueError):  # not installed
        folders.append(str(resolve_package(f"{{{ASSETS}}}/")))
    return tuple(map(Path, folders))


def _is_main_file(path: str) -> bool:
    """Returns whether a file is a world's main file.

    A main file has only keys that main files may have, and at least one key that defines objects.
    """
    from rpbi.config.world import main_file_model  # loads the simulator, which readers of episodes do not need
    from rpbi.world.objects import object_sections

    try:
        keys = set(load_config(path))
    except ConfigError:
        return False
    return bool(keys & set(object_sections())) and keys <= set(main_file_model(object_sections()).model_fields)


def stored_path(store: Path, path: str, digest: str) -> Path:
    """Returns the path of the copy of a file.

    Args:
        store: Folder of the copies.
        path: Path of the file.
        digest: SHA-256 of the file.

    Raises:
        ConfigError: If the copy is a symbolic link.
    """
    return path_below(store.parent, f"{store.name}/{digest}{Path(path).suffix}")


def changed_files(files: Iterable[Mapping[str, Any]], store: Path) -> Iterator[str]:
    """Yields a message for each copy in `store` that is missing, or was changed after it was stored."""
    known: dict[str, str] = {}
    for each in files:
        if not each["sha256"]:
            continue
        name = f"{each['sha256']}{Path(each['path']).suffix}"
        if name not in known:
            try:
                content = read_below(store.parent, f"{store.name}/{name}", MAX_FILE_BYTES)
                known[name] = "" if hashlib.sha256(content).hexdigest() == each["sha256"] else "was changed"
            except ConfigError as error:
                is_there = os.path.lexists(store / name)
                known[name] = error.problems[0].message if is_there else "is missing"
        if known[name]:
            yield f"{store.name}/{name}, the copy of {each['path']}, {known[name]}"


def newer_files(files: Iterable[Mapping[str, Any]]) -> Iterator[str]:
    """Yields a message for each original file whose content now differs from the stored copy."""
    for each in files:
        with suppress(OSError):  # the original file no longer exists
            data = read_file(each["path"], MAX_FILE_BYTES)
            if each["sha256"] and hashlib.sha256(data).hexdigest() != each["sha256"]:
                yield f"{each['path']} differs from its copy in the episode"


def stored_names(files: Iterable[Mapping[str, Any]], folder: Path) -> dict[str, str]:
    """Returns the paths of the files that `with_stored_files` creates in a folder, indexed by original path.

    Raises:
        ConfigError: If a path would be outside of the folder.
    """
    return {each["path"]: str(path_below(folder, each["path"])) for each in files if each["sha256"]}


def with_stored_files(description: str, files: Iterable[Mapping[str, Any]], store: Path, folder: Path) -> str:
    """Writes the stored files into a folder, and returns a world's description that refers to the written files.

    Args:
        description: The world's description as JSON, as on the topic `rpbi/world_description`.
        files: The files, as returned by `store_files`.
        store: Folder of the copies.
        folder: An empty folder, below which files get their original paths. URDFs are changed to use the meshes there.

    Raises:
        ConfigError: If `description` is not the description of a world, or a path would be outside of the folder.
        EpisodeError: If a copy cannot be read, or the files together are too large.
    """
    data = _described(description)
    files = list(files)
    left = MAX_ALL_BYTES
    for each in files:
        if each["sha256"]:
            copy, target = stored_path(store, each["path"], each["sha256"]), path_below(folder, each["path"])
            try:
                content = read_file(copy, min(MAX_FILE_BYTES, left))
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(content)
            except OSError as error:
                raise EpisodeError(copy, f"cannot be read: {error.strerror or error}") from error
            left -= len(content)
    for each in files:
        if meshes := {name: str(path_below(folder, path)) for name, path in each.get("meshes", {}).items()}:
            if each["path"] in data["descriptions"]:
                text = data["descriptions"][each["path"]]
                data["descriptions"][each["path"]] = _with_meshes(text, meshes)
            elif each["sha256"]:
                urdf = path_below(folder, each["path"])
                text = urdf.read_text(encoding="utf-8", errors="surrogateescape")
                urdf.write_text(_with_meshes(text, meshes), encoding="utf-8", errors="surrogateescape")
    moved = {json.dumps(path): json.dumps(here) for path, here in stored_names(files, folder).items()}
    for holder in (data, *data["objects"]):
        holder["config"] = _JSON_TEXT.sub(lambda match: moved.get(match[0], match[0]), holder["config"])
    data["files"] = {path: digest for path, digest in data["files"].items() if path in data["descriptions"]}
    return json.dumps(data)


_QUOTES = {"&quot;": '"', "&apos;": "'"}
_JSON_TEXT = re.compile(r'"(?:[^"\\]|\\.)*"')


def _with_meshes(urdf: str, meshes: Mapping[str, str]) -> str:
    """Replaces mesh file names in a URDF, and returns the URDF. `meshes` maps names in the URDF to new paths."""

    def renamed(match: re.Match[str]) -> str:
        path = meshes.get(unescape(match[3], _QUOTES))
        return match[0] if path is None else match[1] + quoteattr(path)

    return re.sub(r"(\bfilename\s*=\s*)([\"'])(.*?)\2", renamed, urdf)
