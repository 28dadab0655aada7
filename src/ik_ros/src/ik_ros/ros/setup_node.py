"""`ik_setup_node.py SOLVER`: publishes inverse kinematics problems from TF, joint states, tolerances and goals."""

import time
from functools import partial
from typing import Any

import rospy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray, Header

from custom_ros_tools.errors import ConfigError, InterfaceError, Problem
from custom_ros_tools.joint_values import JointValues
from custom_ros_tools.node_configs import StartParameters
from custom_ros_tools.ros.lifecycle.parameters import private_config, private_parameters
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning
from ik_ros.msg import IKProblem as IKProblemMessage
from ik_ros.node_configs import RobotIKConfig, SetupParameters, TargetParameters
from ik_ros.problem import IKProblem, JointPositions
from robot_model.geometry import Pose
from ros_pybullet_interface.msg import CalculateInverseKinematicsProblem
from ros_pybullet_interface.srv import RobotInfo

from .exotica import ExoticaSetup
from .messages import problem_message
from .setup_topics import START_TOPICS, ProblemInputs, publish_problems
from .solver_name import run_for_solver, topics_of, trust_only_what_was_named
from .tf import FreshTf

START_PATIENCE_S = 2.0
"""Time without a start position after which the node warns that it is waiting for a start position [s]."""
TOLERANCES = ("bx", "by", "bz", "brx", "bry", "brz")
NOT_IN_MESSAGES = {"robot_name", "parent_frame_id", "child_frame_id"}
"""Keys of `~config` that are not fields of the message `CalculateInverseKinematicsProblem`."""


class SetupNode:
    """Publishes problems at a fixed rate while switched on and while start and target are available.

    Args:
        name: Name of the solver, which is part of the names of topics and services.

    Raises:
        ConfigError: If a parameter is invalid.
    """

    def __init__(self, name: str) -> None:
        self._config = config = private_parameters(SetupParameters)
        self._topics = topics_of("setup", name)
        start: JointPositions | None = None if config.wait_for_start else {}
        self._inputs = ProblemInputs(self._topics, config.max_num_prev_solutions, start)
        self._tf: FreshTf | None = None
        if config.parent_frame_id is not None and config.child_frame_id is not None:
            self._tf = FreshTf(config.parent_frame_id, config.child_frame_id, config.tf_timeout_s)
        self._began_s = time.monotonic()
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
        self._inputs.subscribe()
        for key in TOLERANCES:
            self._inputs.listen(key, Float64, partial(self._on_tolerance, key))
        for task in self._goals:
            topic = f"task_map_goal/{task}"
            self._inputs.listen(topic, Float64MultiArray, partial(self._on_goal, task))

    def _on_tolerance(self, key: str, message: Float64) -> None:
        changed = {**self._tolerances, key: message.data}
        IKProblem(**_fields(changed))  # the constructor checks them
        self._tolerances = changed

    def _on_goal(self, task: str, message: Float64MultiArray) -> None:
        expected = len(self._config.goals[task])
        if len(message.data) != expected:
            raise ValueError(f"expected {expected} values, as the first goal has, got {len(message.data)}")
        IKProblem(goals={task: message.data})
        self._goals[task] = tuple(message.data)

    def _message(self) -> IKProblemMessage | None:
        if self._inputs.start is None:
            if time.monotonic() - self._began_s > START_PATIENCE_S:
                topic = rospy.resolve_name(f"{self._topics}/{START_TOPICS[0]}")
                raise InterfaceError(f"no start has come yet on {topic}; with ~wait_for_start: false none is needed")
            return None
        problem = self._problem(None if self._tf is None else self._tf.pose())
        return problem_message(problem, Header(stamp=rospy.Time.now(), frame_id=self._config.parent_frame_id or ""))

    def _problem(self, target: Pose | None) -> IKProblem:
        with self._inputs.lock:
            return IKProblem(
                target=target,
                **_fields(self._tolerances),
                start=self._inputs.start or {},
                previous=tuple(self._inputs.previous),
                goals=self._goals,
                seed=self._config.seed,
            )


def _fields(tolerances: dict[str, float]) -> dict[str, Any]:
    values = tuple(tolerances[key] for key in TOLERANCES)
    return {"position_tolerance": values[:3], "rotation_tolerance": values[3:]}


class RobotIKSetup:
    """Publishes problems for a simulated robot's own inverse kinematics (`pybullet` with the parameter `~config`).

    The messages have the type of the robot's topic `rpbi/NAME/ik`, so a solver node is not needed. First waits until
    the robot has reported the order of its joints.

    Raises:
        ConfigError: If `~config` or a parameter is invalid.
        rospy.ROSInterruptException: If ROS shuts down during the wait.
    """

    def __init__(self) -> None:
        self._config = config = private_config(RobotIKConfig)
        timing = private_parameters(TargetParameters)
        start_on_init = private_parameters(StartParameters).start_on_init
        self._tf = FreshTf(config.parent_frame_id, config.child_frame_id, timing.tf_timeout_s)
        self._period_s = 1.0 / timing.hz
        self._warn = ThrottledWarning()
        self._current: list[float] = []
        rospy.set_param("ik_ros/interface", "pybullet")
        self._joints = _joints_of(config.robot_name)
        topics = topics_of("setup", "pybullet")
        self._topic = f"{topics}/currentPosition"
        rospy.Subscriber(self._topic, JointState, self._on_current, queue_size=1)
        publish_problems(topics, CalculateInverseKinematicsProblem, timing.hz, start_on_init, self._problem, False)

    def _on_current(self, message: JointState) -> None:
        try:
            values = JointValues.of(message.name, message.position).in_order(self._joints)
        except (InterfaceError, ValueError) as error:
            self._warn(rospy.resolve_name(self._topic), f"message refused: {error}")
            return
        self._current = list(values.position)

    def _problem(self) -> CalculateInverseKinematicsProblem:
        pose = self._tf.pose()
        return CalculateInverseKinematicsProblem(
            header=Header(stamp=rospy.Time.now(), frame_id=self._config.parent_frame_id),
            targetPosition=pose.position,
            targetOrientation=pose.quat_xyzw,
            currentPosition=self._current,
            dt=self._period_s if self._current else 0.0,
            **self._config.model_dump(exclude=NOT_IN_MESSAGES),
        )


def _joints_of(robot: str) -> tuple[str, ...]:
    """Waits for a robot, and returns the names of the joints that a motor can move."""
    service = rospy.ServiceProxy(f"rpbi/{robot}/robot_info", RobotInfo)
    rospy.loginfo("waiting for %s", service.resolved_name)
    service.wait_for_service()
    return tuple(joint.jointName for joint in service().joint_info if joint.is_revolute or joint.jointType == 1)


def main() -> None:
    """Runs the node."""

    def make(name: str) -> object:
        trust_only_what_was_named()
        if name == "pybullet" and rospy.get_param("~config", {}):  # deleted parameters leave an empty mapping
            return RobotIKSetup()
        if name == "exotica" and not rospy.has_param("~child_frame_id"):
            return ExoticaSetup()
        return SetupNode(name)

    run_for_solver("setup", make)
