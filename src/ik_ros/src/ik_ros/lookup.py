"""From the name of a solver to the solver."""

from collections.abc import Callable, Mapping
from typing import Any, cast

from custom_ros_tools.plugins import configured_class
from custom_ros_tools.schema import ConfigModel

from .solver import Solver
from .solvers import SOLVERS


def solver_class(name: str) -> type[Solver]:
    """Returns the class of a solver.

    Args:
        name: A name of the table `SOLVERS`, or `"their_package.module:Class"`.

    Raises:
        UnknownNameError: If the table does not have the name.
        MissingDependency: If a solver of the table needs a library that is not installed.
        ConfigError: If another package has no such class, or its module cannot be imported.
    """
    return cast(type[Solver], configured_class(name, Solver, SOLVERS, "solver"))


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
