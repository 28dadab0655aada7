"""Configuration files: paths with ROS packages in them, and YAML that is safe to load."""

import os
import re
from collections.abc import Hashable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

import rospkg
import yaml

from .errors import ConfigError, Problem, closest

_SOURCES = Path(__file__).resolve().parents[3]
"""Where the packages of this workspace are, if it runs from its sources."""
_PACKAGE = re.compile(r"package://(?P<uri>[^/{}]+)|\{(?P<braces>[^{}]*)\}")


def ros_package_path(package: str) -> str:
    """Returns the folder of a ROS package.

    It is looked for in ROS_PACKAGE_PATH, and then among the packages that this one stands with.

    Raises:
        ConfigError: If there is no such package.
    """
    search_path = os.environ.get("ROS_PACKAGE_PATH", "")
    packages = _packages(search_path)
    try:
        return str(packages.get_path(package))
    except rospkg.ResourceNotFound:
        match = closest(package, packages.list())
    advice = f"; did you mean '{match}'?" if match else f" (ROS_PACKAGE_PATH is {search_path or 'nothing'})"
    raise ConfigError([Problem("", "", f"unknown ROS package '{package}'{advice}")])


@lru_cache(maxsize=4)
def _packages(search_path: str) -> rospkg.RosPack:
    """Returns what is known under one value of ROS_PACKAGE_PATH; reading it again would cost a crawl."""
    is_source = (_SOURCES / "custom_ros_tools" / "package.xml").is_file()  # installed, it stands with other things
    return rospkg.RosPack([*rospkg.get_ros_paths(), *([str(_SOURCES)] if is_source else [])])


def replace_package(path: str) -> str:
    """Resolves `{package}/path` and `package://package/path`; the first package only, others stay as they are.

    Raises:
        ConfigError: If there is no such package.
    """
    match = _PACKAGE.search(path)
    if match is None:
        return path
    folder = ros_package_path(match["uri"] or match["braces"])
    return path[: match.start()] + folder + path[match.end() :]


def load_config(path: str) -> dict[str, Any]:
    """Returns the mapping in a YAML file; `{package}/path` and `package://package/path` are resolved.

    Raises:
        ConfigError: If the file cannot be read or is not a YAML mapping; it names file, line and column.
    """
    try:
        text = Path(replace_package(path)).read_text(encoding="utf-8")
    except ConfigError as error:
        raise ConfigError([Problem(path, "", problem.message) for problem in error.problems]) from None
    except OSError as error:
        raise ConfigError([Problem(path, "", (error.strerror or str(error)).lower())]) from None
    except UnicodeDecodeError as error:
        raise ConfigError([Problem(path, "", f"is not UTF-8 text: {error.reason} at byte {error.start}")]) from None
    return load_configs(text, path)


def load_configs(text: str, file: str = "text") -> dict[str, Any]:
    """Returns the mapping in a YAML text, which messages call `file`; an empty text is an empty mapping.

    Raises:
        ConfigError: If it is not a YAML mapping, names a key twice, or asks for Python objects.
    """
    try:
        data = yaml.load(text, Loader=_StrictLoader)
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
    """Returns a mapping of plain data as YAML text, in its own order; `load_configs` gives the same mapping back."""
    return str(yaml.safe_dump(dict(config), sort_keys=False))


class _StrictLoader(yaml.SafeLoader):
    """The safe loader, which moreover refuses a key that stands twice in one mapping."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen: dict[Any, yaml.Node] = {}
        for key_node, _ in node.value:
            if key_node.tag == "tag:yaml.org,2002:merge" or not isinstance(key_node, yaml.ScalarNode):
                continue
            key = self.construct_object(key_node)
            if key in seen:
                first = seen[key].start_mark.line + 1
                raise yaml.constructor.ConstructorError(
                    None, None, f"key '{key}' is given twice (first in line {first})", key_node.start_mark
                )
            seen[key] = key_node
        return cast(dict[Hashable, Any], super().construct_mapping(node, deep))
