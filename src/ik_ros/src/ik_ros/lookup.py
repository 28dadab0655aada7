"""The function `make_solver` for scripts."""

from .solvers import SOLVERS

make_solver = SOLVERS.make
"""Makes the solver with a given name, see `PluginTable.make`."""
