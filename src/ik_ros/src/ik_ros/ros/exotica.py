"""EXOTica's messages and services as in the original package, and the setup node `ik_setup_node.py exotica`."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import rospy
from std_msgs.msg import Float64MultiArray, Header

from custom_ros_tools.errors import ConfigError, Problem
from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from ik_ros.msg import EXOTicaProblem, EXOTicaSyncTf
from ik_ros.node_configs import ExoticaSetupParameters
from ik_ros.problem import AttachedFrame, IKProblem
from ik_ros.srv import EXOTicaInfo, EXOTicaInfoResponse
from robot_model.geometry import Pose

from .messages import positions_in, positions_message
from .setup_topics import ProblemInputs, publish_problems
from .solver_name import topics_of
from .tf import FreshTf

if TYPE_CHECKING:
    from ik_ros.solvers.exotica import ExoticaSolver

INFO = "exotica_info"
"""Name of the service with which the solver node describes its task maps."""


def problem_in_exotica(message: EXOTicaProblem) -> IKProblem:
    """Converts a message of the original package to a problem.

    Raises:
        ValueError: If a number is not finite or out of range, or lists differ in length; the message names the field.
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
    """Offers the service `exotica_info`, which returns names, types and sizes of the task maps, and the joint names."""
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


class SyncedFrame(NamedTuple):
    """A frame of the scene whose pose is read from TF.

    Attributes:
        tf_parent: TF frame in which the pose is expressed.
        tf_child: TF frame whose pose is read.
        exo_parent: Frame of the scene that corresponds to `tf_parent`; empty for the root.
        exo_child: Frame of the scene that gets the pose.
    """

    tf_parent: str
    tf_child: str
    exo_parent: str
    exo_child: str


def synced_frames(lines: Sequence[str]) -> list[SyncedFrame]:
    """Parses lines of four names, in the order of the attributes of `SyncedFrame`; `''` stands for the empty name.

    Raises:
        ConfigError: If a line does not have four names.
    """
    frames = []
    for line in lines:
        words = ["" if word in ("''", '""') else word for word in line.replace(",", " ").split()]
        if len(words) != len(SyncedFrame._fields):
            message = f"expected four names ({' '.join(SyncedFrame._fields)}), got {line!r}"
            raise ConfigError([Problem(rospy.get_name(), "sync_tf_to_exotica_object", message)])
        frames.append(SyncedFrame(*words))
    return frames


class ExoticaSetup:
    """Publishes problems for the solver `exotica`, with task map goals and frame poses, as in the original package.

    First waits until the solver node has described its task maps.

    Raises:
        ConfigError: If a parameter is invalid.
        rospy.ROSInterruptException: If ROS shuts down during the wait.
    """

    def __init__(self) -> None:
        config = private_parameters(ExoticaSetupParameters)
        synced = synced_frames(config.sync_tf_to_exotica_object)
        self._frames = [(one, FreshTf(one.tf_parent, one.tf_child, config.tf_timeout_s)) for one in synced]
        info = _info()
        self._goals = {name: [0.0] * size for name, size in zip(info.task_map_names, info.task_map_nrho)}
        rospy.set_param("ik_ros/interface", "exotica")
        topics = topics_of("setup", "exotica")
        self._inputs = ProblemInputs(topics, config.max_num_prev_solutions, {})
        self._inputs.subscribe()
        for name in self._goals:
            self._inputs.listen(f"task_map_goal/{name}", Float64MultiArray, partial(self._on_goal, name))
        publish_problems(topics, EXOTicaProblem, config.hz, config.start_on_init, self._problem)

    def _on_goal(self, name: str, message: Float64MultiArray) -> None:
        if len(message.data) != len(self._goals[name]):
            raise ValueError(f"expected {len(self._goals[name])} values, got {len(message.data)}")
        IKProblem(goals={name: message.data})  # the constructor checks them
        self._goals[name] = list(message.data)

    def _problem(self) -> EXOTicaProblem:
        sync_tf = []
        for synced, tf in self._frames:
            pose = tf.pose()
            sync_tf.append(EXOTicaSyncTf(*synced, [*pose.position, *pose.quat_xyzw]))
        with self._inputs.lock:
            return EXOTicaProblem(
                header=Header(stamp=rospy.Time.now()),
                task_map_names=list(self._goals),
                task_map_goals=[Float64MultiArray(data=values) for values in self._goals.values()],
                start_state=positions_message(self._inputs.start or {}),
                previous_solutions=[positions_message(one) for one in self._inputs.previous],
                sync_tf=sync_tf,
            )


def _info() -> EXOTicaInfoResponse:
    """Waits for the solver node, and returns the solver node's description of its task maps."""
    service = rospy.ServiceProxy(INFO, EXOTicaInfo)
    rospy.loginfo("waiting for %s", service.resolved_name)
    service.wait_for_service()
    return service()
