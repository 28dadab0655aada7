"""Classes of other packages, named as `module:Class`."""

import importlib
import pkgutil
import sys
import traceback
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any, NamedTuple

from custom_ros_tools.errors import hint, shortened

own_folders = [str(Path(__file__).parent)]
"""Folders of the packages that look up and call plug-ins; `cause_of` reports the line outside of these folders."""
_used: set[str] = set()
"""Top-level packages of the classes that `find_class` has found."""


class _Trust(NamedTuple):
    """Packages that may be imported, and advice for the message of a refusal."""

    packages: frozenset[str]
    how: str


_trust: _Trust | None = None
"""Trust of the whole process; None allows any package."""
_trust_here: ContextVar[_Trust | None] = ContextVar("trust of the recording that is being read", default=None)


class UntrustedError(ValueError):
    """A name from outside belongs to a package that may not be imported."""


def trust_only(packages: Iterable[str], how: str) -> None:
    """Restricts `find_class` from now on to these top-level packages and to classes that are imported already.

    Importing a module runs its code. Names read at the start come from the user. Names that arrive later, by services
    or from a bag, are not trusted.

    Args:
        how: Advice for the message on how to trust another package.
    """
    global _trust
    _trust = _Trust(frozenset(packages), how)


@contextmanager
def trusting_only(packages: Iterable[str], how: str) -> Iterator[None]:
    """Does the same as `trust_only` within a context, for a recording that is read in a script.

    In a process that `trust_only` restricts, the packages that it names are trusted, too.
    """
    token = _trust_here.set(_Trust(frozenset(packages), how))
    try:
        yield
    finally:
        _trust_here.reset(token)


def check_trusted(name: str) -> None:
    """Checks a `module:Class` from outside.

    A class is trusted if its package is, or if its module is imported already and `find_class` has found a class of its
    package before.

    Raises:
        UntrustedError: If its package may not be imported.
    """
    restrictions = [each for each in (_trust, _trust_here.get()) if each is not None]
    module = name.partition(":")[0]
    package = module.partition(".")[0]
    is_used = package in _used and module in sys.modules
    if restrictions and not is_used and not any(package in each.packages for each in restrictions):
        raise UntrustedError(f"'{shortened(name)}' is not trusted, so it is not imported: {restrictions[0].how}")


def find(name: str) -> Any:
    """Returns the object of another package under a name, such as `my_robot_lab.conveyor:Conveyor`.

    Raises:
        ValueError: If the module has no such object, or cannot be imported.
    """
    module_name, _, attribute = name.partition(":")
    if not attribute or not all(part.isidentifier() for part in module_name.split(".")):
        raise ValueError(f"expected a name like 'my_package.my_module:MyClass', got '{name}'")
    try:
        module = importlib.import_module(module_name)
    except (Exception, SystemExit) as error:  # SystemExit: raised by a script that runs on import
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
        _used.add(name.partition(":")[0].partition(".")[0])
        return found
    raise ValueError(f"expected a subclass of {full_name(base)}, got '{name}'")


def full_name(thing: Any) -> str:
    """Returns the name by which `find` finds a class or function, or the class of anything else."""
    named = thing if hasattr(thing, "__qualname__") else type(thing)
    return f"{named.__module__}:{named.__qualname__}"


def cause_of(error: BaseException) -> str:
    """Returns in one line the type and message of an error, and the line of the plug-in's package that raised it."""
    text = f"{type(error).__name__}: {error}"
    places = [frame for frame in traceback.extract_tb(error.__traceback__) if _is_elsewhere(frame.filename)]
    if not places or isinstance(error, SyntaxError):  # its text has file and line
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
