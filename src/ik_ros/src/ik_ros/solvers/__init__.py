"""The solvers; a new one is a class in a file of its own and a line here."""

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
"""All solvers; each is imported when it is looked up, so a missing library matters to its own solver only."""
