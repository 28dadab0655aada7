"""Copies by content of the files that a world names, and worlds that read these copies."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from custom_ros_tools.config import read_file
from custom_ros_tools.errors import ConfigError
from custom_ros_tools.files import atomic_file
from robot_model.urdf.document import UrdfDocument
from robot_model.urdf.files import found_mesh

from .errors import EpisodeError

URDF = ".urdf"


def store_files(description: str, store: Path) -> tuple[list[dict[str, Any]], list[str]]:
    """Copies the files that a world's description names, and the meshes of its URDFs, into a folder.

    Args:
        description: JSON, as on `rpbi/world_description`.
        store: The folder; a file is `HASH.EXTENSION` there. Copies that exist are kept.

    Returns:
        For each file its `path`, its `sha256`, and for a URDF `meshes`, their paths by the names in it; and sentences
        on files that are not as they were when the world was loaded, or cannot be read.
    """
    data = json.loads(description)
    stored: dict[str, dict[str, Any]] = {}
    faults: list[str] = []
    for path, expected in data["files"].items():
        if path in data["descriptions"]:
            faults += _store_meshes(path, path, stored, store)
            continue
        digest = _store(path, stored, store, faults)
        if digest not in ("", expected):
            faults.append(f"{path} has changed since the world was loaded")
        if path.lower().endswith(URDF):
            faults += _store_meshes(path, path, stored, store)
    return list(stored.values()), faults


def _store_meshes(urdf: str, source: str, stored: dict[str, dict[str, Any]], store: Path) -> list[str]:
    faults: list[str] = []
    meshes: dict[str, str] = {}
    try:
        document = UrdfDocument(source)
    except ConfigError as error:
        return [str(error)]
    for name in document.meshes:
        try:
            path = str(found_mesh(name, Path(source)).absolute())
        except (ConfigError, OSError):  # the world was loaded without it
            continue
        _store(path, stored, store, faults)
        meshes[name] = path
    stored.setdefault(urdf, {"path": urdf, "sha256": ""})["meshes"] = meshes
    return faults


def _store(path: str, stored: dict[str, dict[str, Any]], store: Path, faults: list[str]) -> str:
    """Copies a file, and returns its hash; empty if it cannot be read."""
    try:
        data = read_file(path)
    except OSError as error:
        faults.append(f"{path} cannot be read: {error.strerror or error}")
        return ""
    digest = hashlib.sha256(data).hexdigest()
    target = stored_path(store, path, digest)
    if not target.exists():
        store.mkdir(parents=True, exist_ok=True)
        with atomic_file(target) as part:
            part.write_bytes(data)
    stored[path] = {"path": path, "sha256": digest}
    return digest


def _digest(path: str | Path) -> str:
    return hashlib.sha256(read_file(path)).hexdigest()


def stored_path(store: Path, path: str, digest: str) -> Path:
    """Returns the copy of a file with a hash."""
    return store / f"{digest}{Path(path).suffix}"


def changed_files(files: Iterable[Mapping[str, Any]], store: Path) -> Iterator[str]:
    """Yields a sentence for each copy that is missing or has another content than when it was stored."""
    for each in files:
        if not each["sha256"]:
            continue
        copy = stored_path(store, each["path"], each["sha256"])
        try:
            if _digest(copy) != each["sha256"]:
                yield f"{copy.parent.name}/{copy.name}, the copy of {each['path']}, was changed"
        except OSError:
            yield f"{copy.parent.name}/{copy.name}, the copy of {each['path']}, is missing"


def newer_files(files: Iterable[Mapping[str, Any]]) -> Iterator[str]:
    """Yields a sentence for each file that is there, with another content than was stored."""
    for each in files:
        with suppress(OSError):  # it is not there any more
            if each["sha256"] and _digest(each["path"]) != each["sha256"]:
                yield f"{each['path']} differs from its copy in the episode"


def with_stored_files(description: str, files: Iterable[Mapping[str, Any]], store: Path, folder: Path) -> str:
    """Returns a world's description that reads the copies instead of the files themselves.

    Args:
        description: JSON, as on `rpbi/world_description`.
        files: As `store_files` returned them.
        store: The folder of the copies.
        folder: An empty folder, in which the files are laid out as they were. URDFs name the meshes there.

    Raises:
        EpisodeError: If a copy cannot be read.
    """
    data = json.loads(description)
    files = list(files)
    for each in files:
        if each["sha256"]:
            copy, target = stored_path(store, each["path"], each["sha256"]), _below(folder, each["path"])
            target.parent.mkdir(parents=True, exist_ok=True)
            try:
                shutil.copyfile(copy, target)
            except OSError as error:
                raise EpisodeError(copy, f"cannot be read: {error.strerror or error}") from error
    for each in files:
        if meshes := {name: str(_below(folder, path)) for name, path in each.get("meshes", {}).items()}:
            if each["path"] in data["descriptions"]:
                text = data["descriptions"][each["path"]]
                data["descriptions"][each["path"]] = _with_meshes(text, meshes)
            else:
                urdf = _below(folder, each["path"])
                text = urdf.read_text(encoding="utf-8", errors="surrogateescape")
                urdf.write_text(_with_meshes(text, meshes), encoding="utf-8", errors="surrogateescape")
    moved = {
        json.dumps(each["path"]): json.dumps(str(_below(folder, each["path"]))) for each in files if each["sha256"]
    }
    for holder in (data, *data["objects"]):
        for old, new in moved.items():
            holder["config"] = holder["config"].replace(old, new)
    data["files"] = {path: digest for path, digest in data["files"].items() if path in data["descriptions"]}
    return json.dumps(data)


def _below(folder: Path, path: str) -> Path:
    return folder / path.lstrip("/")


def _with_meshes(urdf: str, meshes: Mapping[str, str]) -> str:
    """Returns a URDF whose attributes `filename` name other files."""

    def renamed(match: re.Match[str]) -> str:
        return f"{match[1]}{match[2]}{meshes.get(match[3], match[3])}{match[2]}"

    return re.sub(r"(\bfilename\s*=\s*)([\"'])(.*?)\2", renamed, urdf)
