"""Imports classes that names of the form `module:Class` refer to, and restricts such imports."""

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
"""Folders of the packages that look up and call plug-ins. `cause_of` reports the last code line outside the folders."""
_used: set[str] = set()
"""Top-level packages from which `find_class` has returned a class."""


class _Trust(NamedTuple):
    """A restriction of imports.

    Attributes:
        packages: Top-level packages that may be imported.
        how: Advice in the error message of a refused import.
    """

    packages: frozenset[str]
    how: str


_trust: _Trust | None = None
"""Restriction for the whole process; None allows all packages."""
_trust_here: ContextVar[_Trust | None] = ContextVar("trust of the recording that is being read", default=None)


class UntrustedError(ValueError):
    """An untrusted name belongs to a package that must not be imported."""


def trust_only(packages: Iterable[str], how: str) -> None:
    """Restricts `find_class` in the whole process to trusted packages, see `check_trusted`.

    Importing a module runs the module's code. Names that a program reads at its start come from the user, and are
    trusted. Names that arrive later, in service requests or from a bag, are not trusted. So programs call this function
    at the end of their start.

    Args:
        packages: The trusted top-level packages.
        how: Advice on how to trust another package, for the error message.
    """
    global _trust
    _trust = _Trust(frozenset(packages), how)


@contextmanager
def trusting_only(packages: Iterable[str], how: str) -> Iterator[None]:
    """Restricts `find_class` like `trust_only`, but only within a context, for example while a script reads a bag.

    If `trust_only` was called before, the packages of that call remain trusted.
    """
    token = _trust_here.set(_Trust(frozenset(packages), how))
    try:
        yield
    finally:
        _trust_here.reset(token)


def check_trusted(name: str) -> None:
    """Checks that an untrusted name `module:Class` may be imported.

    Without a restriction, all names may be imported. With a restriction, a name may be imported if its top-level
    package is trusted. A name may also be imported if its module is already imported, and `find_class` has returned a
    class from the same package.

    Raises:
        UntrustedError: If the name must not be imported.
    """
    restrictions = [each for each in (_trust, _trust_here.get()) if each is not None]
    module = name.partition(":")[0]
    package = module.partition(".")[0]
    is_used = package in _used and module in sys.modules
    if restrictions and not is_used and not any(package in each.packages for each in restrictions):
        raise UntrustedError(f"'{shortened(name)}' is not trusted, so it is not imported: {restrictions[0].how}")


def find(name: str) -> Any:
    """Imports a module, and returns an object of the module.

    Args:
        name: Module and object, such as `my_robot_lab.conveyor:Conveyor`.

    Raises:
        ValueError: If the module cannot be imported, or lacks the object.
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
    """Imports a class of another package.

    Args:
        name: `module:Class`.
        base: Required base class.

    Raises:
        UntrustedError: If the class must not be imported, see `check_trusted`.
        ValueError: If the class does not exist, or does not derive from `base`.
    """
    check_trusted(name)
    found = find(name)
    if isinstance(found, type) and issubclass(found, base):
        _used.add(name.partition(":")[0].partition(".")[0])
        return found
    raise ValueError(f"expected a subclass of {full_name(base)}, got '{name}'")


def full_name(thing: Any) -> str:
    """Returns `module:name`, as accepted by `find`, of a class or function, or of the class of any other object."""
    named = thing if hasattr(thing, "__qualname__") else type(thing)
    return f"{named.__module__}:{named.__qualname__}"


def cause_of(error: BaseException) -> str:
    """Describes an error: type, message, and the last code line in the traceback that is outside `own_folders`."""
    text = f"{type(error).__name__}: {error}"
    places = [frame for frame in traceback.extract_tb(error.__traceback__) if _is_elsewhere(frame.filename)]
    if not places or isinstance(error, SyntaxError):  # a SyntaxError's message has file and line
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
