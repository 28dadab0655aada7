"""From the name of a solver to the solver."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any, cast

from custom_ros_tools.errors import ConfigError, Problem, UnknownNameError
from custom_ros_tools.schema import ConfigModel

from .solver import Solver
from .solvers import SOLVERS


def solver_class(name: str) -> type[Solver]:
    """Returns the class of a solver.

    Args:
        name: A name of the table `SOLVERS`, or `"their_package.module:Class"`.

    Raises:
        UnknownNameError: If the table does not have the name.
        MissingDependency: If the solver needs a library that is not installed.
        ConfigError: If there is no such module or class, or it is not a `Solver`.
    """
    path = name if ":" in name else SOLVERS.get(name)
    if path is None:
        raise UnknownNameError("solver", name, [*SOLVERS, "their_package.module:Class"])
    module_name, _, class_name = path.partition(":")
    try:
        found = getattr(import_module(module_name), class_name)
    except (ImportError, AttributeError, ValueError) as error:
        raise _no_solver(name, str(error)) from error
    if not (isinstance(found, type) and issubclass(found, Solver)):
        raise _no_solver(name, "expected a class derived from ik_ros.solver.Solver")
    return found


def make_solver(
    name: str, data: Mapping[str, Any], file: str = "~", context: Mapping[str, Any] | None = None
) -> Solver:
    """Makes a solver.

    Args:
        name: See `solver_class`.
        data: Its options, as read from YAML.
        file: Where they come from, for messages and relative paths; `"~"` for parameters of a node.
        context: What validators find beside `file`, see `ConfigModel.parse`.

    Raises:
        UnknownNameError: If there is no solver of this name.
        MissingDependency: If it needs a library that is not installed.
        ConfigError: If its options are wrong; it names file and key of all that are.
    """
    kind = solver_class(name)
    make = cast(Callable[[ConfigModel], Solver], kind)
    return make(kind.Config.parse(data, file, context))


def _no_solver(name: str, why: str) -> ConfigError:
    return ConfigError([Problem("", "", f"solver '{name}': {why}")])
