"""Loads YAML configuration files safely, and resolves ROS packages in paths."""

import errno
import gc
import os
import re
import stat
from collections.abc import Hashable, Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

import rospkg
import yaml

from .errors import ConfigError, Problem, closest, shortened

_HERE = Path(__file__).resolve()
SOURCES = _HERE.parents[3] if (_HERE.parents[2] / "package.xml").is_file() else None
"""Folder of this workspace's packages, if the code runs from its sources; None in an install space or a wheel."""
_SHARE = _HERE.with_name("share")
"""Folder of this workspace's packages in a wheel, without their code."""
MAX_BYTES = 16_000_000
"""Largest length of a YAML file or text; longer files are rejected."""
MAX_VALUES = 1_000_000
"""Largest number of values in a YAML file; files with more values are rejected.

Values that aliases (`*NAME`) repeat are counted each time.
"""
MAX_NUMBER_LENGTH = 1000
"""Largest number of characters in a number. A longer scalar without a tag is read as text."""
_INT, _FLOAT = "tag:yaml.org,2002:int", "tag:yaml.org,2002:float"
_PACKAGE = re.compile(r"package://(?P<uri>[^/{}]+)|\{(?P<braces>[^{}]*)\}")


def ros_package_path(package: str) -> str:
    """Returns the folder of a ROS package.

    Raises:
        ConfigError: If the package is not found.
    """
    packages = ros_packages()
    try:
        return str(packages.get_path(package))
    except rospkg.ResourceNotFound:
        match = closest(package, packages.list())
    search_path = os.environ.get("ROS_PACKAGE_PATH") or "nothing"
    advice = f"; did you mean '{match}'?" if match else f" (ROS_PACKAGE_PATH is {search_path})"
    raise ConfigError([Problem("", "", f"unknown ROS package '{package}'{advice}")])


def ros_packages() -> rospkg.RosPack:
    """Returns the index of the ROS packages in ROS_PACKAGE_PATH, then in the sources or the wheel of this workspace."""
    return _packages(os.environ.get("ROS_PACKAGE_PATH", ""))


@lru_cache(maxsize=4)
def _packages(search_path: str) -> rospkg.RosPack:
    """Returns the index for a value of ROS_PACKAGE_PATH.

    The result is cached, since making the index reads all folders.
    """
    own = [str(folder) for folder in (SOURCES, _SHARE) if folder is not None and folder.is_dir()]
    return rospkg.RosPack([*rospkg.get_ros_paths(), *own])


def replace_package(path: str) -> str:
    """Replaces the first `{package}` or `package://package` in a path by the folder of the ROS package.

    Returns:
        The new path; a path that does not contain a package is unchanged.

    Raises:
        ConfigError: If the package is not found.
    """
    match = _PACKAGE.search(path)
    if match is None:
        return path
    folder = ros_package_path(match["uri"] or match["braces"])
    return path[: match.start()] + folder + path[match.end() :]


def read_file(path: str | Path, most_bytes: int | None = None) -> bytes:
    """Reads an ordinary file.

    Refuses pipes and devices, since reading them might block or never end. Files in /proc are read as empty, since they
    report the size 0.

    Args:
        path: The file.
        most_bytes: Largest size; by default unlimited.

    Raises:
        OSError: If the file cannot be read, is not an ordinary file, or is too large.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except ValueError as error:  # a null character
        raise OSError(errno.EINVAL, str(error)) from None
    with open(descriptor, "rb") as file:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            raise OSError(errno.EINVAL, "is a folder" if stat.S_ISDIR(status.st_mode) else "is not an ordinary file")
        if most_bytes is not None and status.st_size > most_bytes:
            raise OSError(errno.EFBIG, f"has {status.st_size} bytes, expected at most {most_bytes}")
        return file.read(status.st_size)


def load_config(path: str, most_bytes: int = MAX_BYTES) -> dict[str, Any]:
    """Reads a YAML file that contains a mapping.

    Args:
        path: The file; `{package}/path` and `package://package/path` are resolved.
        most_bytes: Largest size of the file.

    Raises:
        ConfigError: If the file cannot be read or is not a YAML mapping; the message names file, line and column.
    """
    try:
        text = read_file(replace_package(path), most_bytes).decode()
    except ConfigError as error:
        raise ConfigError([Problem(path, "", problem.message) for problem in error.problems]) from None
    except OSError as error:
        raise ConfigError([Problem(path, "", (error.strerror or str(error)).lower())]) from None
    except UnicodeDecodeError as error:
        raise ConfigError([Problem(path, "", f"is not UTF-8 text: {error.reason} at byte {error.start}")]) from None
    return load_configs(text, path)


def load_configs(s: str, file: str = "text", most_characters: int = MAX_BYTES) -> dict[str, Any]:
    """Parses a YAML text that contains a mapping; an empty text gives an empty mapping.

    Args:
        s: The text.
        file: Name of the text in error messages.
        most_characters: Largest length of the text.

    Raises:
        ConfigError: If the text is not a YAML mapping, repeats a key, has tags for Python objects, or is too large.
    """
    if len(s) > most_characters:
        raise ConfigError([Problem(file, "", f"has {len(s)} characters, expected at most {most_characters}")])
    try:
        with _without_collections():
            data = yaml.load(s, Loader=_StrictLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        raise ConfigError([Problem(file, "", f"{where}{error.problem or error.context}")]) from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        first_line = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ConfigError([Problem(file, "", f"is not YAML: {first_line}")]) from None
    if data is None:
        return {}
    if not isinstance(data, dict):
        raise ConfigError([Problem(file, "", f"expected a mapping of keys to values, got {type(data).__name__}")])
    return cast(dict[str, Any], data)


def config_to_str(config: Mapping[str, Any]) -> str:
    """Converts a mapping of plain data to a YAML text, which `load_configs` can read. The order of keys is kept."""
    return str(yaml.safe_dump(dict(config), sort_keys=False))


@contextmanager
def _without_collections() -> Iterator[None]:
    """Switches off garbage collection within a context, since collecting many new objects would block all threads."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def _dismantle(root: yaml.Node) -> None:
    """Frees the nodes of a tree one by one, since freeing a large tree at once would block all threads."""
    waiting = [root]
    while waiting:
        node = waiting.pop()
        if isinstance(node, yaml.CollectionNode):
            for child in node.value:
                waiting += child if isinstance(child, tuple) else [child]
            node.value = []


class _StrictLoader(yaml.SafeLoader):
    """PyYAML's safe loader, which also rejects repeated keys in a mapping, and texts with too many values."""

    def get_single_data(self) -> Any:
        node = self.get_single_node()
        if node is None:
            return None
        if _size(node, {}) > MAX_VALUES:
            raise yaml.YAMLError(f"its aliases repeat more than {MAX_VALUES} values")
        try:
            return self.construct_document(node)
        finally:
            _dismantle(node)

    def resolve(self, kind: type[yaml.Node], value: Any, implicit: Any) -> Any:
        """Reads a very long scalar as text, since matching it with PyYAML's patterns would block all threads."""
        if kind is yaml.ScalarNode and len(value) > MAX_NUMBER_LENGTH:
            implicit = (False, True)
        return super().resolve(kind, value, implicit)

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        is_number = isinstance(node, yaml.ScalarNode) and node.tag in (_INT, _FLOAT)
        try:
            if is_number and len(node.value) > MAX_NUMBER_LENGTH:  # base-60 numbers are slow to compute
                raise ValueError("too long")
            return super().construct_object(node, deep)
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError):
            wanted = node.tag.removeprefix("tag:yaml.org,2002:")
            got = shortened(node.value) if isinstance(node, yaml.ScalarNode) else f"a {node.id}"
            raise yaml.constructor.ConstructorError(
                None, None, f"expected a value of the type {shortened(wanted)}, got '{got}'", node.start_mark
            ) from None

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen: dict[Any, yaml.Node] = {}
        for key_node, _ in node.value if isinstance(node, yaml.MappingNode) else ():
            if key_node.tag == "tag:yaml.org,2002:merge" or not isinstance(key_node, yaml.ScalarNode):
                continue
            key = self.construct_object(key_node)
            if not isinstance(key, Hashable):  # reported when the mapping is constructed
                continue
            if key in seen:
                first = seen[key].start_mark.line + 1
                raise yaml.constructor.ConstructorError(
                    None,
                    None,
                    f"key '{shortened(str(key))}' is given twice (first in line {first})",
                    key_node.start_mark,
                )
            seen[key] = key_node
        return cast(dict[Hashable, Any], super().construct_mapping(node, deep))


def _size(node: yaml.Node, known: dict[int, int]) -> int:
    """Counts the values in a node; values that aliases repeat are counted each time.

    Args:
        node: The node.
        known: Known counts, indexed by `id` of the node; 0 for nodes whose counting has not ended.

    Raises:
        yaml.YAMLError: If a node contains itself.
    """
    if isinstance(node, yaml.ScalarNode):
        return 1
    if id(node) in known:
        if not known[id(node)]:
            raise yaml.YAMLError("an alias refers to a value that contains it")
        return known[id(node)]
    known[id(node)] = 0
    children = node.value if isinstance(node, yaml.SequenceNode) else [part for pair in node.value for part in pair]
    known[id(node)] = 1 + sum(_size(child, known) for child in children)
    return known[id(node)]
