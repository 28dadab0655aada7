"""Services and the action that plan motions of a robot without collisions, show them in RViz, and execute them."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import actionlib
import rospy
from std_srvs.srv import Trigger, TriggerResponse
from trajectory_msgs.msg import JointTrajectory

from custom_ros_tools.errors import InterfaceError, UnknownNameError, bounded
from custom_ros_tools.ros.lifecycle.parameters import private_config
from ros_pybullet_interface.msg import Prediction
from rpbi.bodies.robots.robot import Robot
from rpbi.ros.headers import world_frame
from rpbi_planning import plan
from rpbi_planning.foresee import SETTLING_S
from rpbi_planning.msg import MotionRequest, MoveRobotAction, MoveRobotFeedback, MoveRobotResult
from rpbi_planning.node_configs import MotionPlannerConfig
from rpbi_planning.path_check import PathCheck
from rpbi_planning.scene import PlanningScene
from rpbi_planning.srv import (
    PlanAndMove,
    PlanAndMoveRequest,
    PlanAndMoveResponse,
    PlanMotion,
    PlanMotionRequest,
    PlanMotionResponse,
)

from .motion_messages import constraints_in, goal_in, positions_in, trajectory_message
from .plan_markers import PlanMarkers
from .prediction_client import distances_m, poses_at_end, predicted
from .scene_topics import SceneTopics
from .trajectory_client import TrajectoryClient

PAUSE_S = 0.5
"""Time between two attempts while an obstacle is in the way [s]."""
MAX_PLANS = 20
"""Largest number of motions that are planned for a request."""
START_RAD = 0.02
"""Largest distance of a joint from the start of a shown plan that is to be executed [rad or m]."""
PLANNING, MOVING, STOPPING = "planning", "moving", "stopping"


class _Outcome(NamedTuple):
    """Result of a request: whether the robot is at the goal, a summary, and the number of plans."""

    success: bool
    message: str
    plans: int


class _Planned(NamedTuple):
    """A plan with its request, the robot, and what the simulator predicts if that was asked for."""

    request: MotionRequest
    robot: Robot
    result: Any
    prediction: Prediction | None = None
    foreseen: str = ""


class MotionServices:
    """Offers services and an action that plan and execute motions; see docs/planning.md.

    Raises:
        ConfigError: If the configuration is not valid.
    """

    def __init__(self) -> None:
        self._config = private_config(MotionPlannerConfig)
        self._topics = SceneTopics(self._config)
        self._markers = PlanMarkers()
        self._busy = threading.Lock()
        self._stopped = threading.Event()
        self._clients: dict[str, TrajectoryClient] = {}
        self._shown: _Planned | None = None
        rospy.Service("planner/plan", PlanMotion, self._on_plan)
        rospy.Service("planner/plan_and_move", PlanAndMove, self._on_move)
        rospy.Service("planner/plan_to_frame", Trigger, lambda _: self._triggered(self._plan_to_frame))
        rospy.Service("planner/move", Trigger, lambda _: self._triggered(self._move_shown))
        rospy.Service("planner/stop", Trigger, self._on_stop)
        self._action = actionlib.SimpleActionServer(
            "planner/move_robot", MoveRobotAction, self._on_goal, auto_start=False
        )
        self._action.start()

    # --- Services and action

    def _on_plan(self, request: PlanMotionRequest) -> PlanMotionResponse:
        start_s = time.monotonic()
        try:
            with self._work():
                planned = self._plan(request.request, self._is_stopped)
        except (InterfaceError, ValueError) as error:
            failed = PlanMotionResponse(success=False, message=bounded(str(error)))
            failed.planning_time = time.monotonic() - start_s
            return failed
        result = planned.result
        trajectory = trajectory_message(result.joint_names, result.trajectory) if result.success else JointTrajectory()
        message = result.message or f"a motion of {result.trajectory.duration_s:.2f} s"
        message += f"; {planned.foreseen}" if planned.foreseen else ""
        prediction = planned.prediction or Prediction()
        planning_s = time.monotonic() - start_s
        return PlanMotionResponse(result.success, message, trajectory, planning_s, result.planner, prediction)

    def _on_move(self, request: PlanAndMoveRequest) -> PlanAndMoveResponse:
        return PlanAndMoveResponse(*self._move(request.request, self._is_stopped, lambda _: None))

    def _on_goal(self, goal: Any) -> None:
        def is_cancelled() -> bool:
            return self._is_stopped() or bool(self._action.is_preempt_requested())

        sent = self._action.current_goal.get_goal_id().stamp
        outcome = self._move(goal.request, is_cancelled, self._action.publish_feedback, sent)
        result = MoveRobotResult(*outcome)
        if outcome.success:
            self._action.set_succeeded(result, outcome.message)
        elif self._action.is_preempt_requested():
            self._action.set_preempted(result, outcome.message)
        else:
            self._action.set_aborted(result, outcome.message)

    def _on_stop(self, _: Any) -> TriggerResponse:
        if not self._busy.locked():
            return TriggerResponse(False, "there is nothing to stop")
        self._stopped.set()
        return TriggerResponse(True, "stopping")

    def _triggered(self, action: Callable[[], str]) -> TriggerResponse:
        try:
            with self._work():
                return TriggerResponse(True, action())
        except (InterfaceError, ValueError) as error:
            return TriggerResponse(False, bounded(str(error)))

    def _plan_to_frame(self) -> str:
        """Plans to `goal_frame`, which is dragged in RViz, and shows the plan."""
        robot = self._topics.robot()
        request = MotionRequest(link=self._link(robot))
        request.pose.header.frame_id = self._config.goal_frame
        request.pose.pose.orientation.w = 1.0
        result = self._plan(request, self._is_stopped).result
        if not result.success:
            raise InterfaceError(result.message)
        return f"a motion of {result.trajectory.duration_s:.2f} s; planner/move executes it"

    def _move_shown(self) -> str:
        """Executes the newest plan, if the robot is still at its start; otherwise plans again."""
        if self._shown is None:
            raise InterfaceError("there is no plan to execute: call planner/plan_to_frame first")
        outcome = self._move_planned(self._shown, self._is_stopped, lambda _: None)
        if not outcome.success:
            raise InterfaceError(outcome.message)
        return outcome.message

    # --- Planning

    @contextmanager
    def _work(self) -> Iterator[None]:
        """Lets only one request run.

        Raises:
            InterfaceError: If another request runs.
        """
        if not self._busy.acquire(blocking=False):
            raise InterfaceError("the planner is busy with another request; planner/stop ends it")
        self._stopped.clear()
        try:
            yield
        finally:
            self._busy.release()

    def _is_stopped(self) -> bool:
        return self._stopped.is_set() or rospy.is_shutdown()

    def _plan(self, request: MotionRequest, is_cancelled: Callable[[], bool], at_present: bool = False) -> _Planned:
        """Plans a motion in the present scene, and shows it.

        Args:
            request: The request.
            is_cancelled: Tells whether to end early.
            at_present: Whether the motion must start at the present positions of the joints.

        Raises:
            InterfaceError: If the request or the scene is not valid.
            ValueError: Likewise.
        """
        self._topics.wait()
        config, robot = self._config, self._topics.robot(request.robot)
        if at_present and request.start.name:
            raise InterfaceError("start: expected none, since the motion starts at the present positions")
        if request.foresee and request.start.name:
            raise InterfaceError("foresee: expected no start, since the simulator predicts from its present state")
        goal = goal_in(request, self._topics)
        scene = self._scene_for(request, robot)
        options: dict[str, Any] = {
            "start": positions_in(request.start, "start") or None,
            "group": tuple(request.group) or config.group or _controlled(robot),
            "constraints": constraints_in(request),
            "planner": request.planner or config.planner,
            "time_limit_s": request.time_limit or config.time_limit_s,
            "shorten_s": max(request.shorten or config.shorten_s, 0.0),
            "seed": request.seed,
            "certify": config.certify,
            "is_cancelled": is_cancelled,
        }
        planned = _Planned(request, robot, plan(scene, robot.name, goal, **options))
        if planned.result.success:
            self._show(planned)
            if request.foresee:
                planned = self._foresee(planned)
        return planned

    def _foresee(self, planned: _Planned) -> _Planned:
        """Adds the effects of a motion that starts at the present positions.

        Raises:
            InterfaceError: If the simulator cannot predict it.
        """
        result, present = planned.result, self._topics.dynamic_objects()
        found = predicted(planned.robot.name, result.joint_names, result.trajectory, present, self._topics.dt_s)
        return planned._replace(prediction=found[0], foreseen=found[1])

    def _scene_for(self, request: MotionRequest, robot: Robot) -> PlanningScene:
        """Returns the present scene, in which the robot holds the bodies of a request and no others.

        Raises:
            InterfaceError: If the scene or the request is not valid.
            ValueError: Likewise.
        """
        scene = self._topics.present()
        for body in list(scene.held):
            scene.detach(body)
        for pair in list(scene.allowed):
            scene.forbid(*pair)
        scene = self._topics.present()  # with the measured poses of bodies that were held
        if request.held and not request.held_link:
            raise InterfaceError("held_link: expected the link that holds the bodies, got none")
        for body in request.held:
            scene.attach(body, robot.name, request.held_link)
            for other in request.may_touch:
                if other not in scene.names:
                    raise UnknownNameError("body", other, scene.names)
                scene.allow(body, other)
        return scene

    def _show(self, planned: _Planned) -> None:
        self._shown = planned
        link = planned.request.link or self._link(planned.robot)
        with self._topics.lock:
            base, start = self._topics.state(planned.robot)
            self._markers.show(planned.robot, base, start, planned.result, link, world_frame())

    def _link(self, robot: Robot) -> str:
        """Returns the link whose path is shown, and which comes to `goal_frame`."""
        return self._config.link or str(robot.link_name(robot.joints[-1].index))

    # --- Motion

    def _move(
        self,
        request: MotionRequest,
        is_cancelled: Callable[[], bool],
        report: Callable[[Any], None],
        sent: rospy.Time | None = None,
    ) -> _Outcome:
        try:
            with self._work():
                report(MoveRobotFeedback(phase=PLANNING))
                self._topics.wait()
                self._topics.wait_for(sent or rospy.Time())
                planned = self._plan(request, is_cancelled, at_present=True)
                if not planned.result.success:
                    return _Outcome(False, planned.result.message, 1)
                return self._move_planned(planned, is_cancelled, report)
        except (InterfaceError, ValueError) as error:
            return _Outcome(False, bounded(str(error)), 0)

    def _move_planned(
        self, planned: _Planned, is_cancelled: Callable[[], bool], report: Callable[[Any], None]
    ) -> _Outcome:
        """Executes a plan. If an obstacle comes into the way, stops, plans again and continues.

        Raises:
            InterfaceError: If the robot does not move or stop as planned.
            ValueError: If the scene is not valid any more.
        """
        for plans in range(1, MAX_PLANS + 1):
            block = self._execute(planned, plans, is_cancelled, report)
            if block is None:
                message = f"at the goal, after {plans} plan{'s' * (plans > 1)}{self._compared(planned)}"
                return _Outcome(True, message, plans)
            report(MoveRobotFeedback(phase=PLANNING, plans=plans))
            end_s = time.monotonic() + self._config.wait_s
            while not is_cancelled():
                planned.request.seed += 1  # another attempt with the same random numbers would fail alike
                planned = self._plan(planned.request, is_cancelled)
                if planned.result.success:
                    break
                if time.monotonic() > end_s:
                    return _Outcome(False, f"stopped: {block}; {planned.result.message}", plans)
                rospy.rostime.wallsleep(PAUSE_S)
            if is_cancelled():
                return _Outcome(False, "cancelled; the robot is at rest", plans)
        return _Outcome(False, f"stopped after {MAX_PLANS} plans: {block}", MAX_PLANS)

    def _execute(
        self, planned: _Planned, plans: int, is_cancelled: Callable[[], bool], report: Callable[[Any], None]
    ) -> str | None:
        """Follows a planned trajectory to its end.

        Returns:
            None at the goal; otherwise the reason for which the robot has stopped: an obstacle, or a cancelled request.

        Raises:
            InterfaceError: If the robot does not move or stop as planned.
        """
        robot, result = planned.robot, planned.result
        self._require_start(planned)
        client, check = self._client(robot), PathCheck(self._topics.present(), robot.name, result.joint_names)
        self._markers.hide_ghost()
        _, present = self._topics.state(robot)
        client.start(result.joint_names, result.trajectory, present)
        try:
            while not client.wait(1.0 / self._config.check_hz):
                elapsed_s, duration_s = client.elapsed_s, result.trajectory.duration_s
                report(MoveRobotFeedback(MOVING, elapsed_s / duration_s, duration_s - elapsed_s, plans))
                reason = "cancelled" if is_cancelled() else self._obstacle(planned, check, elapsed_s)
                if reason:
                    rospy.logwarn("%s: stops: %s", robot.name, reason)
                    report(MoveRobotFeedback(STOPPING, elapsed_s / duration_s, 0.0, plans))
                    client.stop()
                    return reason
        except Exception:
            client.stop()  # no motion without checks
            raise
        if client.fault:
            raise InterfaceError(client.fault)
        return None

    def _compared(self, planned: _Planned) -> str:
        """Returns the largest distance of a dynamic object from its foreseen place, as a clause; empty without one."""
        if planned.prediction is None:
            return ""
        foreseen = poses_at_end(planned.prediction)
        try:
            rospy.sleep(SETTLING_S)
            present = {name: pose for name, pose in self._topics.dynamic_objects().items() if name in foreseen}
        except (InterfaceError, rospy.ROSException) as error:  # the robot is at the goal all the same
            return f"; {planned.foreseen}; not compared: {error}"
        errors = distances_m(present, foreseen)
        if not errors:
            return f"; {planned.foreseen}"
        worst = max(errors, key=lambda name: errors[name])
        return f"; {planned.foreseen}; farthest from its foreseen place: '{worst}', {1e3 * errors[worst]:.1f} mm"

    def _require_start(self, planned: _Planned) -> None:
        result = planned.result
        _, present = self._topics.state(planned.robot)
        for name, position in zip(result.joint_names, result.trajectory.positions[0]):
            if not abs(present[name] - position) <= START_RAD:
                expected = f"expected joint '{name}' at the start of the plan, {position:.3f}"
                raise InterfaceError(f"{expected}, got {present[name]:.3f}: plan again")

    def _obstacle(self, planned: _Planned, check: PathCheck, elapsed_s: float) -> str:
        """Returns a description of an obstacle on the remaining path; empty without an obstacle."""
        try:
            if self._topics.present() is not check.scene:  # bodies were added or removed
                check.scene = self._scene_for(planned.request, planned.robot)
            return check.first_meeting(planned.result.trajectory, elapsed_s)
        except (InterfaceError, ValueError) as error:
            return str(error)

    def _client(self, robot: Robot) -> TrajectoryClient:
        if robot.name not in self._clients:
            action = self._config.action or f"rpbi/{robot.name}/joint_trajectory_controller/follow_joint_trajectory"
            acceleration = self._config.acceleration
            self._clients[robot.name] = TrajectoryClient(action, _controlled(robot), acceleration)
        return self._clients[robot.name]


def _controlled(robot: Robot) -> tuple[str, ...]:
    """Returns the joints of a robot's trajectory controller.

    Raises:
        InterfaceError: If the robot does not have this controller.
    """
    if robot.follower is None:
        raise InterfaceError(
            f"robot '{robot.name}': expected the key joint_trajectory_controller in its file, got none"
        )
    return robot.follower.joint_names
