"""The solvers; a new one is a class in a file of its own and a line here.

A user's own one needs no line: `"their_package.module:Class"` serves wherever a name does.
"""

SOLVERS: dict[str, str] = {
    "kdl": "ik_ros.solvers.kdl:KdlSolver",
    "pybullet": "ik_ros.solvers.pybullet_solver:PybulletSolver",
    "trac_ik": "ik_ros.solvers.trac_ik:TracIkSolver",
    "global": "ik_ros.solvers.global_search:GlobalSolver",
    "tasks": "ik_ros.solvers.tasks:TasksSolver",
    "trajectory": "ik_ros.solvers.trajectory:TrajectorySolver",
}
"""Class of each solver; imported when it is asked for, so that libraries that others lack do not matter."""
