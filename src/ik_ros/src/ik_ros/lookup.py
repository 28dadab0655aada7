"""The function that makes a solver by its name, for scripts."""

from .solvers import SOLVERS

make_solver = SOLVERS.make
"""Makes a solver, see `PluginTable.make`."""
