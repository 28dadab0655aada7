"""Classes of other packages, named as `module:Class`."""

import importlib
import pkgutil
import traceback
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from .errors import ConfigError, Problem, UnknownNameError, hint, shortened

own_folders = [str(Path(__file__).parent)]
"""Folders of the packages that look classes up and call them; `cause_of` looks for the fault outside of these."""
_found: set[str] = set()
"""Names that `find_class` has found."""
_trust: tuple[frozenset[str], str] | None = None
"""Packages that `find_class` may import from, and how to add to them; None is from anywhere."""


class UntrustedError(ValueError):
    """A name comes from outside, and its package is not one that may be imported."""


def trust_only(packages: Iterable[str], how: str) -> None:
    """Has `find_class` refuse from now on whatever it has not found before and is not of these top-level packages.

    Importing a module runs it. What is read at the start is the user's own; what comes later, by services, or out of a
    bag, may be anybody's.

    Args:
        how: What the user does to have another package trusted, for the message.
    """
    global _trust
    _trust = frozenset(packages), how


def check_trusted(name: str) -> None:
    """Checks a `module:Class` that comes from outside.

    Raises:
        UntrustedError: If it may not be imported.
    """
    package = name.partition(":")[0].partition(".")[0]
    if _trust is not None and name not in _found and package not in _trust[0]:
        raise UntrustedError(f"'{shortened(name)}' is not trusted, so it is not imported: {_trust[1]}")


class ClassTable(Mapping[str, Any]):
    """Classes by name, made of a `module:Class` for each, which is imported when it is asked for."""

    def __init__(self, paths: Mapping[str, str]) -> None:
        self._paths = paths

    def __getitem__(self, name: str) -> Any:
        return pkgutil.resolve_name(self._paths[name])

    def __iter__(self) -> Iterator[str]:
        return iter(self._paths)

    def __len__(self) -> int:
        return len(self._paths)

    def name_of(self, thing: Any) -> str:
        """Returns the name of a class, or of an object's class; `module:Class` of one that is not in the table."""
        path = full_name(thing)
        return next((name for name, each in self._paths.items() if each == path), path)


def find(name: str) -> Any:
    """Returns what another package offers under a name, such as `my_robot_lab.conveyor:Conveyor`.

    Raises:
        ValueError: If there is no such thing, or its module cannot be imported.
    """
    module_name, _, attribute = name.partition(":")
    if not attribute or not all(part.isidentifier() for part in module_name.split(".")):
        raise ValueError(f"expected a name like 'my_package.my_module:MyClass', got '{name}'")
    try:
        module = importlib.import_module(module_name)
    except (Exception, SystemExit) as error:  # SystemExit: a script that runs when it is imported
        missing = error.name if isinstance(error, ModuleNotFoundError) else None
        if missing is not None and f"{module_name}.".startswith(f"{missing}."):
            raise ValueError(_is_missing(missing)) from None
        raise ValueError(f"'{module_name}' cannot be imported: {cause_of(error)}") from error
    if not hasattr(module, attribute):
        known = [each for each in vars(module) if not each.startswith("_")]
        raise ValueError(f"'{module_name}' has no '{attribute}'{hint(attribute, known)}")
    return getattr(module, attribute)


def find_class(name: str, base: type) -> Any:
    """Returns a class of another package by its `module:Class`.

    Raises:
        UntrustedError: If it may not be imported, see `trust_only`.
        ValueError: If there is no such class, or it is no subclass of `base`.
    """
    check_trusted(name)
    found = find(name)
    if isinstance(found, type) and issubclass(found, base):
        _found.add(name)
        return found
    raise ValueError(f"expected a subclass of {full_name(base)}, got '{name}'")


def find_in_table(name: str, base: type, table: Mapping[str, str], kind: str) -> Any:
    """Returns a class of a table, or of another package.

    Args:
        name: A name of the table, or `module:Class`.
        base: What a class of another package must be a subclass of.
        table: `module:Class` by name; a module is imported when it is asked for.
        kind: What the classes are, for the message.

    Raises:
        UnknownNameError: If the table does not have the name.
        ValueError: If another package has no such class.
        MissingDependency: If the module of the table says so.
    """
    if ":" in name:
        return find_class(name, base)
    if name not in table:
        raise UnknownNameError(kind, name, [*table, "their_package.module:Class"])
    return pkgutil.resolve_name(table[name])


def configured_class(name: str, base: type, table: Mapping[str, str], kind: str) -> Any:
    """Returns what `find_in_table` does, for a name in somebody's configuration.

    Raises:
        UnknownNameError: If the table does not have the name.
        MissingDependency: If it needs a library that is not installed.
        ConfigError: If another package has no such class, or its module cannot be imported.
    """
    try:
        return find_in_table(name, base, table, kind)
    except ValueError as error:
        raise ConfigError([Problem("", "", f"{kind} '{name}': {error}")]) from error


def full_name(thing: Any) -> str:
    """Returns the name by which `find` finds a class or function, or the class of anything else."""
    named = thing if hasattr(thing, "__qualname__") else type(thing)
    return f"{named.__module__}:{named.__qualname__}"


def cause_of(error: BaseException) -> str:
    """Returns what happened and where in the package of the class, in one line."""
    text = f"{type(error).__name__}: {error}"
    places = [frame for frame in traceback.extract_tb(error.__traceback__) if _is_elsewhere(frame.filename)]
    if not places or isinstance(error, SyntaxError):  # which tells its place itself
        return text
    return f"{text} ({places[-1].filename}, line {places[-1].lineno})"


def _is_elsewhere(file: str) -> bool:
    return not file.startswith((*own_folders, "<frozen importlib")) and "/importlib/" not in file


def _is_missing(module: str) -> str:
    outer, _, inner = module.rpartition(".")
    if not outer:
        return f"no module '{module}': is its package built, and its workspace sourced?"
    folders = getattr(importlib.import_module(outer), "__path__", ())
    return f"'{outer}' has no module '{inner}'{hint(inner, [each.name for each in pkgutil.iter_modules(folders)])}"
