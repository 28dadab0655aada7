"""`ik_setup_node.py SOLVER`: TF, joint states, tolerances and goals in, problems of inverse kinematics out."""

import threading
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

import rospy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray, Header

from custom_ros_tools.errors import ConfigError, Problem
from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning
from ik_ros.msg import IKProblem as IKProblemMessage
from ik_ros.node_configs import SetupParameters
from ik_ros.problem import IKProblem, JointPositions
from rpbi.geometry import Pose

from .messages import positions_in, problem_message
from .robot_ik_setup import RobotIKSetup
from .solver_nodes import QUEUE_SIZE, publish_problems, run_for_solver, topics_of
from .tf import FreshTf

START_TOPICS = ("qinit", "start_state", "currentPosition")
"""Names that the release's solvers have for the same."""
PREVIOUS_TOPICS = ("previous_solutions", "previous_solution")
TOLERANCES = ("bx", "by", "bz", "brx", "bry", "brz")


class SetupNode:
    """Publishes a problem at a rate, while it is switched on and there is a target.

    Args:
        name: Name of the solver; it is in the names of topics and services.

    Raises:
        ConfigError: If a parameter is wrong.
    """

    def __init__(self, name: str) -> None:
        self._config = config = private_parameters(SetupParameters)
        self._topics = topics_of("setup", name)
        self._warn = ThrottledWarning()
        self._lock = threading.Lock()
        self._tf: FreshTf | None = None
        if config.parent_frame_id is not None and config.child_frame_id is not None:
            self._tf = FreshTf(config.parent_frame_id, config.child_frame_id, config.tf_timeout_s)
        self._start: JointPositions = {}
        self._previous: deque[JointPositions] = deque(maxlen=config.max_num_prev_solutions)
        self._goals = dict(config.goals)
        self._tolerances = {key: getattr(config, f"init_{key}") for key in TOLERANCES}
        try:
            self._problem(None)
        except ValueError as error:
            raise ConfigError([Problem(rospy.get_name(), "", str(error))]) from None
        rospy.set_param("ik_ros/interface", name)
        self._subscribe()
        publish_problems(self._topics, IKProblemMessage, config.hz, config.start_on_init, self._message)

    def _subscribe(self) -> None:
        for topic in START_TOPICS:
            self._listen(topic, JointState, partial(self._take_start, topic))
        for topic in PREVIOUS_TOPICS:
            self._listen(topic, JointState, partial(self._take_previous, topic))
        for key in TOLERANCES:
            self._listen(key, Float64, partial(self._take_tolerance, key))
        for task in self._goals:
            topic = f"task_map_goal/{task}"
            self._listen(topic, Float64MultiArray, partial(self._take_goal, task))

    def _listen(self, topic: str, message_type: type, take: Callable[[rospy.Message], None]) -> None:
        full_name = f"{self._topics}/{topic}"

        def checked(message: rospy.Message) -> None:
            try:
                with self._lock:
                    take(message)
            except ValueError as error:
                self._warn(rospy.resolve_name(full_name), f"message refused: {error}")

        rospy.Subscriber(full_name, message_type, checked, queue_size=QUEUE_SIZE, tcp_nodelay=True)

    def _take_start(self, topic: str, message: JointState) -> None:
        self._start = positions_in(topic, message)

    def _take_previous(self, topic: str, message: JointState) -> None:
        self._previous.append(positions_in(topic, message))

    def _take_tolerance(self, key: str, message: Float64) -> None:
        changed = {**self._tolerances, key: message.data}
        IKProblem(**_fields(changed))  # which checks them
        self._tolerances = changed

    def _take_goal(self, task: str, message: Float64MultiArray) -> None:
        expected = len(self._config.goals[task])
        if len(message.data) != expected:
            raise ValueError(f"expected {expected} values, as the first goal has, got {len(message.data)}")
        IKProblem(goals={task: message.data})
        self._goals[task] = tuple(message.data)

    def _message(self) -> IKProblemMessage:
        problem = self._problem(None if self._tf is None else self._tf.pose())
        return problem_message(problem, Header(stamp=rospy.Time.now(), frame_id=self._config.parent_frame_id or ""))

    def _problem(self, target: Pose | None) -> IKProblem:
        with self._lock:
            return IKProblem(
                target=target,
                **_fields(self._tolerances),
                start=self._start,
                previous=tuple(self._previous),
                goals=self._goals,
                seed=self._config.seed,
            )


def _fields(tolerances: dict[str, float]) -> dict[str, Any]:
    values = tuple(tolerances[key] for key in TOLERANCES)
    return {"position_tolerance": values[:3], "rotation_tolerance": values[3:]}


def main() -> None:
    """Runs the node."""

    def make(name: str) -> object:
        return RobotIKSetup() if name == "pybullet" and rospy.has_param("~config") else SetupNode(name)

    run_for_solver("setup", make)
