"""Finds the files that a configuration names, and defines field types that require an existing file."""

import os
import sys
from collections.abc import Sequence
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, ValidationInfo

from custom_ros_tools.config import replace_package
from custom_ros_tools.errors import ConfigError, MissingDependency, shortened
from custom_ros_tools.schema import Expects, Text

ROBOT_DESCRIPTION = "robot_description"
"""Value of a file name that selects the robot description on the parameter server."""
PYBULLET_DATA_PATH = "pybullet_data_path"
"""Value in search paths that selects the folder of PyBullet's data."""
LONGEST_PATH = 1000
"""Largest length of a path [bytes]; PyBullet copies paths into buffers of 1024 bytes."""
KERNEL_FOLDERS = ("/proc/", "/sys/", "/dev/")
"""Folders with special files, whose reading may never end."""
ASSETS = "example-robot-data"
"""Python package that the extra `assets` installs, with robot models. Paths name the package like a ROS package, for
example `{example-robot-data}/robots/...`."""


def find_file(name: str, file: str, search_paths: Sequence[str] = ()) -> str:
    """Returns the absolute path of a file that a YAML file names.

    Searches the folder of the YAML file, the search paths and PyBullet's data, in this order.

    Args:
        name: Path in the YAML file; `{package}/path` and `package://package/path` are resolved.
        file: The YAML file, or `~config` for a configuration from the parameter server, which has no folder.
        search_paths: Additional folders to search.

    Raises:
        ValueError: If the file does not exist, or the package is unknown.
    """
    _refuse_long(name)
    path = resolve_package(name)
    folders = [*search_paths, *pybullet_data()]
    if not file.startswith("~"):
        folders.insert(0, str(Path(file).resolve().parent))
    candidates = [path] if path.is_absolute() else [Path(folder) / path for folder in folders]
    try:
        candidate = next((each for each in candidates if each.is_file()), None)
        is_of_kernel = candidate is not None and str(candidate.resolve()).startswith(KERNEL_FOLDERS)
    except OSError as error:
        raise ValueError(f"{shortened(name)}: {(error.strerror or str(error)).lower()}") from None
    if candidate is not None:
        found = str(candidate.resolve() if ".." in candidate.parts else candidate.absolute())
        _refuse_long(found)
        if is_of_kernel:
            raise ValueError(f"expected an ordinary file, got {found}")
        return found
    if any(candidate.is_dir() for candidate in candidates):
        raise ValueError(f"expected a file, got the folder {name}")
    where = "" if path.is_absolute() else f" (looked in {', '.join(map(str, folders))})"
    if where and file.startswith("~"):
        where += "; a configuration on the parameter server has no folder: write {package}/PATH or the full path"
    raise ValueError(f"no such file: {path if path.is_absolute() else name}{where}")


def _existing(name: str, info: ValidationInfo) -> str:
    context = info.context or {}
    return find_file(name, context.get("file", "~"), context.get("search_paths", ()))


def _existing_or_description(name: str, info: ValidationInfo) -> str:
    if name == ROBOT_DESCRIPTION:
        return str((info.context or {}).get(ROBOT_DESCRIPTION) or name)
    return _existing(name, info)


def find_folder(name: str, file: str) -> str:
    """Returns the absolute path of a folder that a YAML file names.

    Args:
        name: Path in the YAML file, as for `find_file`; relative paths start at the YAML file's folder. The name
            `pybullet_data_path` selects the folder of PyBullet's data.
        file: The YAML file, or `~config` for a configuration from the parameter server, which has no folder.

    Raises:
        ValueError: If the folder does not exist, or the package is unknown.
    """
    _refuse_long(name)
    if name == PYBULLET_DATA_PATH:
        if not (folders := pybullet_data()):
            raise ValueError(str(MissingDependency("pybullet_data", "./rpbi setup")))
        return folders[0]
    folder = resolve_package(name)
    if not folder.is_absolute() and not file.startswith("~"):
        folder = Path(file).resolve().parent / folder
    if not folder.is_dir():
        raise ValueError(f"no such folder: {folder}")
    return str(folder.absolute())


@lru_cache(maxsize=1)
def pybullet_data() -> tuple[str, ...]:
    """Returns the folder of PyBullet's data, or an empty tuple if it is not installed; does not import PyBullet."""
    spec = find_spec("pybullet_data")
    return tuple(spec.submodule_search_locations or ()) if spec else ()


def _refuse_long(path: str) -> None:
    if len(os.fsencode(path)) > LONGEST_PATH:
        raise ValueError(f"expected a path of at most {LONGEST_PATH} bytes, got {shortened(path)}")


def resolve_package(name: str) -> Path:
    """Resolves `{package}/path` and `package://package/path` to a path; returns any other path unchanged.

    Raises:
        ValueError: If the package is unknown, or the path needs the extra `assets`, which is not installed.
    """
    for prefix in (f"{{{ASSETS}}}/", f"package://{ASSETS}/"):
        if name.startswith(prefix):
            return _assets() / name.removeprefix(prefix)
    try:
        return Path(replace_package(name))
    except ConfigError as error:
        raise ValueError(str(error)) from None


def _assets() -> Path:
    try:
        return _assets_below(tuple(sys.path))
    except MissingDependency as missing:
        raise ValueError(str(missing)) from missing


@lru_cache(maxsize=1)
def _assets_below(entries: tuple[str, ...]) -> Path:
    folders = (Path(entry) / "cmeel.prefix" / "share" / ASSETS for entry in entries)
    found = next((folder for folder in folders if folder.is_dir()), None)
    if found is None:
        raise MissingDependency(ASSETS, "./rpbi setup assets")
    return found


ExistingFile = Annotated[Text, AfterValidator(_existing), Expects("a file name")]
"""Absolute path of an existing file. The validation context contains the arguments `file` and `search_paths` of
`find_file`."""
RobotFile = Annotated[Text, AfterValidator(_existing_or_description), Expects("a file name")]
"""Like `ExistingFile`, but also accepts the word `robot_description`. If the validation context contains a file for
`robot_description`, the path of that file replaces the word."""
