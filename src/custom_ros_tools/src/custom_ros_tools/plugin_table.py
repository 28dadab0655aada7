"""The class of the tables of plug-ins, such as solvers, tasks, sensors, controllers, devices and primitives."""

import ast
import importlib.util
import inspect
import pkgutil
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar, cast

from pydantic import ValidationInfo

from custom_ros_tools.schema.json_schema import Schema, json_schemas
from custom_ros_tools.schema.type_names import shown

from .errors import ConfigError, MissingDependency, Problem, UnknownNameError
from .plugins import find_class, full_name
from .schema import ConfigModel, InnerProblemsError, KeyedError

Plugin = TypeVar("Plugin")
_Model = TypeVar("_Model", bound=ConfigModel)


class PluginTable(Mapping[str, type[Plugin]]):
    """Table of the plug-in classes of one kind, indexed by name. A class is imported when it is looked up.

    Users can write `module:Class`, for a class in their own package, wherever they can write a name from the table.

    Args:
        kind: Noun for a plug-in in messages and documentation, such as `solver`.
        base: Base class of the plug-ins, as `module:Class`. The table may contain classes that do not derive from
            the base class; users cannot select these classes.
        paths: `module:Class` of each plug-in, indexed by name.
        suggests: Whether the error message for an unknown name lists the known names.
    """

    def __init__(self, kind: str, base: str, paths: Mapping[str, str], suggests: bool = True) -> None:
        self.kind = kind
        self._base, self._paths, self._suggests = base, paths, suggests

    def __getitem__(self, name: str) -> type[Plugin]:
        return cast(type[Plugin], pkgutil.resolve_name(self._paths[name]))

    def __iter__(self) -> Iterator[str]:
        return iter(self._paths)

    def __contains__(self, name: object) -> bool:
        return name in self._paths

    def __len__(self) -> int:
        return len(self._paths)

    @cached_property
    def base(self) -> type[Plugin]:
        """The base class, from which plug-ins of other packages must derive."""
        return cast(type[Plugin], pkgutil.resolve_name(self._base))

    def name_of(self, thing: Any) -> str:
        """Returns the table's name for a class or an object's class, or `module:Class` if the table lacks the class."""
        path = full_name(thing)
        return next((name for name, each in self._paths.items() if each == path), path)

    # --- Look-up and making

    def find(self, name: str) -> type[Plugin]:
        """Looks up a plug-in class.

        Args:
            name: A name in the table, or `module:Class`.

        Raises:
            UnknownNameError: If the name is not in the table. With `suggests=False`, a ValueError is raised instead.
            UntrustedError: If the class belongs to a package that must not be imported.
            ValueError: If `module:Class` does not exist or cannot be imported, or does not derive from `base`.
            MissingDependency: If the class needs a library that is not installed.
        """
        if name in self and issubclass(self[name], self.base):
            return self[name]
        if self._suggests and ":" not in name:
            raise UnknownNameError(self.kind, name, [*self, "their_package.module:Class"])
        return cast(type[Plugin], find_class(name, self.base))

    def configured(self, name: str, file: str = "", key: str = "") -> type[Plugin]:
        """Looks up a plug-in class that is named in a configuration.

        Does the same as `find`, but raises a ConfigError instead of a ValueError.

        Args:
            name: A name in the table, or `module:Class`.
            file: Path of the configuration file, for error messages.
            key: Key in the file whose value is the name, for error messages.

        Raises:
            UnknownNameError: If the name is not in the table.
            MissingDependency: If the class needs a library that is not installed.
            ConfigError: If `module:Class` does not exist, cannot or must not be imported, or has another base class.
        """
        try:
            return self.find(name)
        except ValueError as error:
            text = str(error) if key else f"{self.kind} '{name}': {error}"
            raise ConfigError([Problem(file, key, text)]) from error

    def make(
        self, name: str, data: Mapping[str, Any], file: str = "~", context: Mapping[str, Any] | None = None
    ) -> Plugin:
        """Validates the options of a plug-in, and makes the plug-in. The constructor must only take the options.

        Args:
            name: A name in the table, or `module:Class`.
            data: Options of the plug-in, as read from YAML.
            file: Source of the options, for messages and relative paths; `"~"` for parameters of a node.
            context: Additional entries of the validation context, see `ConfigModel.parse`.

        Raises:
            UnknownNameError: If the name is not in the table.
            MissingDependency: If the plug-in needs a library that is not installed.
            ConfigError: If options are invalid; the message names file and key of each fault.
        """
        make: Any = self.configured(name)
        return cast(Plugin, make(make.Config.parse(data, file, context)))

    # --- Configuration and schema

    def parse_entry(self, entry: Any, info: ValidationInfo, model: type[_Model], expected: str) -> _Model:
        """Validates a YAML entry whose key `type` names a plug-in, with the plug-in's `Config`; for use in validators.

        Args:
            entry: The entry as read from YAML; an instance of `model` is returned unchanged.
            info: Pydantic's information about the validation.
            model: Base class of the plug-ins' configurations.
            expected: Description of a valid entry, for the error message if `entry` is not a mapping with a type.

        Raises:
            ValueError: If the entry is invalid.
        """
        if isinstance(entry, model):
            return entry
        kind = entry.get("type") if isinstance(entry, Mapping) else None
        if not isinstance(kind, str):
            raise ValueError(f"expected {expected}; got {shown(entry)}")
        try:
            found = config_of(self.find(kind), model)
        except ValueError as error:
            raise KeyedError("type", str(error)) from None
        context = info.context or {}
        try:
            return found.parse(entry, context.get("file", ""), context)
        except ConfigError as error:
            raise InnerProblemsError(error.problems) from None

    def configs(self) -> dict[str, type[ConfigModel]]:
        """Returns option models, indexed by plug-in name; leaves out plug-ins whose libraries are not installed."""
        found = {}
        for name in self:
            with suppress(MissingDependency):
                found[name] = config_of(self[name], ConfigModel)
        return found

    def schemas(self) -> dict[str, Schema]:
        """Returns the JSON Schemas of the option models, indexed by plug-in name; see `configs`."""
        return json_schemas(self.configs())

    # --- Documentation

    def summaries(self) -> dict[str, str]:
        """Returns first paragraphs of docstrings, indexed by plug-in name, without importing the plug-ins' modules."""
        return {name: _summary(path) for name, path in self._paths.items()}


def config_of(found: Any, base: type[_Model]) -> type[_Model]:
    """Returns the option model of a plug-in class, which is the class attribute `Config`.

    Args:
        found: The plug-in class.
        base: Class from which the model must derive.

    Raises:
        ValueError: If the class lacks a `Config`, or `Config` does not derive from `base`.
    """
    model = getattr(found, "Config", None)
    if isinstance(model, type) and issubclass(model, base):
        return model
    raise ValueError(f"expected a Config in '{full_name(found)}' that is a subclass of {full_name(base)}")


def _summary(path: str) -> str:
    module, _, name = path.partition(":")
    spec = importlib.util.find_spec(module)
    assert spec is not None and spec.origin is not None
    for node in ast.parse(Path(spec.origin).read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ClassDef) and node.name == name:
            text = inspect.cleandoc(ast.get_docstring(node) or "")
            return " ".join(text.partition("\n\n")[0].split())
    raise ValueError(f"'{module}' has no class '{name}'")
