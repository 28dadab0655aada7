"""The function `make_solver` for scripts."""

from .solvers import SOLVERS

make_solver = SOLVERS.make
"""Makes a solver that is given by name, see `PluginTable.make`."""
