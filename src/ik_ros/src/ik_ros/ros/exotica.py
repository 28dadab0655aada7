"""Problems and the service of EXOTica, compatible with clients of the authors' release."""

from __future__ import annotations

from typing import TYPE_CHECKING

import rospy

from ik_ros.msg import EXOTicaProblem, EXOTicaSyncTf
from ik_ros.problem import AttachedFrame, IKProblem
from ik_ros.srv import EXOTicaInfo, EXOTicaInfoResponse
from robot_model.geometry import Pose

from .messages import positions_in

if TYPE_CHECKING:
    from ik_ros.solvers.exotica import ExoticaSolver

INFO = "exotica_info"
"""Service of the solver's node."""


def problem_in_exotica(message: EXOTicaProblem) -> IKProblem:
    """Returns the problem in a message of the release's.

    Raises:
        ValueError: If a number is not finite or out of its range, or lengths differ; it names the field.
    """
    names, goals = message.task_map_names, message.task_map_goals
    if len(names) != len(goals):
        raise ValueError(f"task_map_goals: expected {len(names)}, one for each task map, got {len(goals)}")
    return IKProblem(
        start=positions_in("start_state", message.start_state),
        previous=tuple(
            positions_in(f"previous_solutions[{i}]", one) for i, one in enumerate(message.previous_solutions)
        ),
        goals={name: goal.data for name, goal in zip(names, goals)},
        frames={sync.exo_child: AttachedFrame(sync.exo_parent, _pose_in(sync)) for sync in message.sync_tf},
    )


def _pose_in(sync: EXOTicaSyncTf) -> Pose:
    if len(sync.transform) != 7:
        message = f"expected 7 numbers (x, y, z, qx, qy, qz, qw), got {len(sync.transform)}"
        raise ValueError(f"sync_tf: '{sync.exo_child}': {message}")
    x, y, z, qx, qy, qz, qw = sync.transform
    return Pose((x, y, z), (qx, qy, qz, qw))


def serve_info(solver: ExoticaSolver) -> None:
    """Serves `exotica_info`: the names, types and sizes of task maps, and the joints."""
    names = list(solver.maps)
    response = EXOTicaInfoResponse(
        xml_filename=solver.config.xml_filename,
        use_scipy_solver=solver.config.use_scipy_solver,
        scipy_solver_method=solver.config.scipy_solver_method,
        task_map_names=names,
        task_map_types=[f"exotica::{solver.maps[name].kind()}" for name in names],
        task_map_nrho=[solver.map_size(name) for name in names],
        controlled_joint_names=solver.joint_names,
    )
    rospy.Service(INFO, EXOTicaInfo, lambda _: response)
