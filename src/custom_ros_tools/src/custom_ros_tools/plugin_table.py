"""The tables of plug-ins: bodies, sensors, controllers, solvers, tasks, devices, mappings, checks and primitives."""

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
    """Classes of one kind by name; each is imported when it is looked up.

    Wherever a name of the table is valid, `module:Class` of another package is valid too.

    Args:
        kind: Noun for one class, used in messages and on pages, such as `solver`.
        base: `module:Class` that those of other packages derive from. Classes of the table that do not derive from it
            are only used by other classes, and cannot be selected by name.
        paths: `module:Class` by name.
        suggests: Whether the message for an unknown name lists the known ones.
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
        """The class that all plug-ins of other packages derive from."""
        return cast(type[Plugin], pkgutil.resolve_name(self._base))

    def name_of(self, thing: Any) -> str:
        """Returns the name of a class, or of an object's class; `module:Class` if it is not in the table."""
        path = full_name(thing)
        return next((name for name, each in self._paths.items() if each == path), path)

    # --- Look-up and making

    def find(self, name: str) -> type[Plugin]:
        """Returns the class of a name.

        Args:
            name: A name of the table, or `module:Class`.

        Raises:
            UnknownNameError: If the table does not have the name, and suggests others.
            UntrustedError: If the class belongs to a package that may not be imported.
            ValueError: If another package has no such class, or it does not derive from `base`.
            MissingDependency: If it needs a library that is not installed.
        """
        if name in self and issubclass(self[name], self.base):
            return self[name]
        if self._suggests and ":" not in name:
            raise UnknownNameError(self.kind, name, [*self, "their_package.module:Class"])
        return cast(type[Plugin], find_class(name, self.base))

    def configured(self, name: str, file: str = "", key: str = "") -> type[Plugin]:
        """Returns the class that a configuration names.

        Args:
            name: A name of the table, or `module:Class`.
            file: The file that has the name, for messages.
            key: The key that has it.

        Raises:
            UnknownNameError: If the table does not have the name.
            MissingDependency: If it needs a library that is not installed.
            ConfigError: If another package has no such class, or its module cannot be imported.
        """
        try:
            return self.find(name)
        except ValueError as error:
            text = str(error) if key else f"{self.kind} '{name}': {error}"
            raise ConfigError([Problem(file, key, text)]) from error

    def make(
        self, name: str, data: Mapping[str, Any], file: str = "~", context: Mapping[str, Any] | None = None
    ) -> Plugin:
        """Makes a plug-in whose only argument is its configuration.

        Args:
            name: A name of the table, or `module:Class`.
            data: Its options, as read from YAML.
            file: Source of the options, for messages and relative paths; `"~"` for parameters of a node.
            context: Further entries for validators, see `ConfigModel.parse`.

        Raises:
            UnknownNameError: If the table does not have the name.
            MissingDependency: If it needs a library that is not installed.
            ConfigError: If the options are wrong; it names file and key of each.
        """
        make: Any = self.configured(name)
        return cast(Plugin, make(make.Config.parse(data, file, context)))

    # --- Configuration and schema

    def parse_entry(self, entry: Any, info: ValidationInfo, model: type[_Model], expected: str) -> _Model:
        """Returns the configuration of an entry with a `type`, by the model of its class; for pydantic's validators.

        Args:
            entry: The entry as read from YAML, or the configuration itself.
            model: Base of the configuration.
            expected: Description of an entry, for the message if this is no mapping with a type.

        Raises:
            ValueError: If the entry does not fit.
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
        """Returns the models of the options by name, of those whose libraries are installed."""
        found = {}
        for name in self:
            with suppress(MissingDependency):
                found[name] = config_of(self[name], ConfigModel)
        return found

    def schemas(self) -> dict[str, Schema]:
        """Returns the JSON Schemas of the options by name, of those whose libraries are installed."""
        return json_schemas(self.configs())

    # --- Documentation

    def summaries(self) -> dict[str, str]:
        """Returns the first sentence of each class's docstring by name, without importing its module."""
        return {name: _summary(path) for name, path in self._paths.items()}


def config_of(found: Any, base: type[_Model]) -> type[_Model]:
    """Returns the model of the YAML of a class.

    Raises:
        ValueError: If it has none, or one of another base.
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
