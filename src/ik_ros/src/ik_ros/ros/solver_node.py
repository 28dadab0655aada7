"""`ik_solver_node.py SOLVER`: receives inverse kinematics problems, and publishes joint targets."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, cast

import genpy
import rospy
from geometry_msgs.msg import Pose
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory

from custom_ros_tools.errors import ConfigError, InterfaceError, Problem
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning
from custom_ros_tools.ros.services import Toggle, ToggleService
from ik_ros.msg import EXOTicaProblem, TracIKProblem
from ik_ros.msg import IKProblem as IKProblemMessage
from ik_ros.msg import IKSolution as IKSolutionMessage
from ik_ros.node_configs import SolverNodeParameters
from ik_ros.problem import IKProblem, IKSolution
from ik_ros.problem_stream import JointRateLimiter, ProblemStream
from ik_ros.solvers import SOLVERS
from ik_ros.srv import (
    EXOTica,
    EXOTicaRequest,
    EXOTicaResponse,
    JointNames,
    JointNamesResponse,
    SolveIK,
    SolveIKRequest,
    SolveIKResponse,
    TracIK,
    TracIKRequest,
    TracIKResponse,
)

from .exotica import problem_in_exotica, serve_info
from .messages import pose_message, problem_in, problem_in_trac_ik, trajectory_message
from .solver_name import run_for_solver, topics_of, trust_only_what_was_named
from .tf import BaseFrame

if TYPE_CHECKING:
    from ik_ros.solvers.exotica import ExoticaSolver

QUEUE_SIZE = 10
PROBLEMS: dict[str, tuple[type[genpy.Message], Callable[[genpy.Message], IKProblem]]] = {
    IKProblemMessage._type: (IKProblemMessage, problem_in),
    TracIKProblem._type: (TracIKProblem, problem_in_trac_ik),
}
"""Messages that every solver accepts on the topic `ik`, by type name: message class, and conversion function."""


class SolverNode:
    """Solves problems from the topic `ik` while switched on, and problems from service calls at any time.

    Args:
        name: Name of the solver, or `module:Class`.

    Raises:
        ConfigError: If a parameter is invalid.
        MissingDependency: If the solver needs a library that is not installed.
    """

    def __init__(self, name: str) -> None:
        own, options = _parameters()
        self._name, self._solver = name, SOLVERS.make(name, options, rospy.get_name())
        trust_only_what_was_named()
        self._continuity = own.continuity
        self._new_stream()
        self._base = BaseFrame(own.base_frame_id)
        self._warn = ThrottledWarning()
        self._solving = threading.Lock()
        self._publishing = threading.Lock()
        self._stream: ProblemStream | None = None
        self._is_received = False
        self._topic = rospy.resolve_name("ik")
        self._target = rospy.Publisher("joint_states/target", JointState, queue_size=QUEUE_SIZE, tcp_nodelay=True)
        self._solution = rospy.Publisher("ik/solution", IKSolutionMessage, queue_size=QUEUE_SIZE, tcp_nodelay=True)
        self._trajectory = rospy.Publisher("ik/trajectory", JointTrajectory, queue_size=QUEUE_SIZE)
        solving = Toggle("solving", self._listen, self._listen_no_more)
        if own.start_on_init:
            solving.on()
        services = topics_of("solver", name)
        ToggleService(f"{services}/toggle", solving.on, solving.off)
        rospy.Service(f"{services}/joint_names", JointNames, lambda _: JointNamesResponse(self._solver.joint_names))
        self._readers = PROBLEMS
        by_type = {"solve_ik": (SolveIK, self._serve), "solve_trac_ik": (TracIK, self._serve_trac_ik)}
        by_type["solve"] = by_type["solve_trac_ik" if name == "trac_ik" else "solve_ik"]  # as in the original package
        if name == "exotica":
            self._readers = {**PROBLEMS, EXOTicaProblem._type: (EXOTicaProblem, problem_in_exotica)}
            by_type["solve"] = EXOTica, self._serve_exotica
            serve_info(cast("ExoticaSolver", self._solver))
        for service, (service_type, serve) in by_type.items():
            rospy.Service(f"{services}/{service}", service_type, serve)

    def _new_stream(self) -> ProblemStream:
        if self._continuity is None:
            return ProblemStream(self._solver)
        try:
            continuity = JointRateLimiter(self._continuity, self._solver.joint_names, self._solver.velocity_limits)
        except ValueError as error:
            raise ConfigError([Problem(rospy.get_name(), "", str(error))]) from None
        return ProblemStream(self._solver, continuity)

    def _listen(self) -> None:
        self._stream = self._new_stream()
        # queue_size=1: older problems are dropped
        self._subscriber = rospy.Subscriber(
            "ik", rospy.AnyMsg, self._on_message, callback_args=self._stream, queue_size=1, tcp_nodelay=True
        )

    def _listen_no_more(self) -> None:
        with self._publishing:
            self._stream = None
        self._subscriber.unregister()

    def _on_message(self, raw: rospy.AnyMsg, stream: ProblemStream) -> None:
        type_name = raw._connection_header["type"]
        if type_name not in self._readers:
            self._warn(self._topic, f"expected {' or '.join(self._readers)}, got {type_name}; refused")
            return
        message_type, read = self._readers[type_name]
        message = message_type().deserialize(raw._buff)
        header, target = message.header, None
        try:
            with self._solving:
                if self._continuity is not None:
                    if not self._is_received:
                        stream.restart()  # nobody has received targets, so the robot has not moved
                    self._is_received = any(each.get_num_connections() for each in (self._target, self._solution))
                problem = self._base.with_poses_in_it(read(message), header.frame_id)
                solution = stream.solve(problem, header.stamp.to_sec())
                target = stream.target
        except (InterfaceError, ValueError) as error:
            self._warn(self._topic, f"problem refused: {error}")
            solution = IKSolution(False, str(error), self._solver.joint_names, ())
        else:
            if not solution.success:
                self._warn("ik/solution", solution.message)
        with self._publishing:
            if stream is self._stream:  # unless switched off in the meantime
                self._publish(solution, target, header.stamp)

    def _publish(self, solution: IKSolution, target: Sequence[float] | None, stamp: rospy.Time) -> None:
        names, positions = solution.joint_names, solution.positions
        if target is not None:
            self._target.publish(JointState(header=Header(stamp=stamp), name=self._solver.joint_names, position=target))
        if solution.success and solution.trajectory is not None:
            self._trajectory.publish(trajectory_message(names, solution.trajectory))
        self._solution.publish(
            IKSolutionMessage(
                header=Header(stamp=stamp),
                interface_name=self._name,
                success=solution.success,
                message=solution.message,
                joint_names=names,
                solution=positions,
            )
        )

    def _serve(self, request: SolveIKRequest) -> SolveIKResponse:
        solution = self._solve_alone(problem_in, request.problem)
        names = solution.joint_names
        return SolveIKResponse(
            base_pose=Pose() if solution.base_pose is None else pose_message(solution.base_pose),
            success=solution.success,
            message=solution.message,
            solution=JointState(name=names, position=solution.positions),
            position_error=solution.position_error_m,
            orientation_error=solution.orientation_error_rad,
            alternatives=[JointState(name=names, position=positions) for positions in solution.alternatives],
            trajectory=trajectory_message(names, solution.trajectory),
        )

    def _serve_trac_ik(self, request: TracIKRequest) -> TracIKResponse:
        return TracIKResponse(*_in_short(self._solve_alone(problem_in_trac_ik, request.problem)))

    def _serve_exotica(self, request: EXOTicaRequest) -> EXOTicaResponse:
        return EXOTicaResponse(*_in_short(self._solve_alone(problem_in_exotica, request.problem)))

    def _solve_alone(self, read: Callable[[genpy.Message], IKProblem], message: genpy.Message) -> IKSolution:
        """Solves one problem, independently of the problems on the topic.

        Args:
            read: Function that converts the message to a problem.
            message: The message with the problem.
        """
        try:
            problem = read(message)
            with self._solving:
                return self._solver.solve(self._base.with_poses_in_it(problem, message.header.frame_id))
        except (InterfaceError, ValueError) as error:
            return IKSolution(False, str(error), (), ())


def _in_short(solution: IKSolution) -> tuple[bool, str, JointState]:
    """Converts a solution to the three response fields of the services `TracIK` and `EXOTica`."""
    return solution.success, solution.message, JointState(name=solution.joint_names, position=solution.positions)


def _parameters() -> tuple[SolverNodeParameters, dict[str, object]]:
    """Reads the private parameters, and splits them into the node's own parameters and the solver's options."""
    given = rospy.get_param("~", {})
    own = {key: value for key, value in given.items() if key in SolverNodeParameters.model_fields}
    options = {key: value for key, value in given.items() if key not in own}
    return SolverNodeParameters.parse(own, rospy.get_name()), options


def main() -> None:
    """Runs the node."""
    run_for_solver("solver", SolverNode)
