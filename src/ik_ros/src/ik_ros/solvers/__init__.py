"""The table of solvers. To add a solver, write a class in a new file, and add a line to the table."""

from custom_ros_tools.plugin_table import PluginTable
from ik_ros.solver import Solver

SOLVERS: PluginTable[Solver] = PluginTable(
    "solver",
    "ik_ros.solver:Solver",
    {
        "kdl": "ik_ros.solvers.kdl:KdlSolver",
        "pybullet": "ik_ros.solvers.pybullet_solver:PybulletSolver",
        "trac_ik": "ik_ros.solvers.trac_ik:TracIkSolver",
        "global": "ik_ros.solvers.global_search:GlobalSolver",
        "tasks": "ik_ros.solvers.tasks:TasksSolver",
        "exotica": "ik_ros.solvers.exotica:ExoticaSolver",
        "trajectory": "ik_ros.solvers.trajectory:TrajectorySolver",
    },
)
"""All solvers, indexed by name. A solver's module is imported when the solver is looked up, so a missing library only
affects the solvers that need the library."""
