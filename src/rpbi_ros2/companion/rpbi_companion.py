#!/usr/bin/env python3
"""Services and actions of the simulator for ROS 2: copy this file to a computer with ROS 2, and run it there.

    python3 rpbi_companion.py

It needs rclpy. It reaches the simulator by two topics of its bridge, which `ros2:=true` starts. The services of
std_srvs take their arguments from parameters of this node:

    ros2 param set /rpbi_companion file push.world
    ros2 service call /rpbi/save std_srvs/srv/Trigger

With simulation_interfaces installed, it also has services of these types, such as `/rpbi/spawn_entity`. With
control_msgs installed, it has the action `/rpbi/ROBOT/joint_trajectory_controller/follow_joint_trajectory`.
"""

import json
import queue
import re
import threading
import time
import uuid
from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import Any

import rclpy
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.time import Time
from std_msgs.msg import String
from std_srvs.srv import Trigger

ANSWER_S = 600.0  # longest time to the next answer about a request [s]
CONNECT_S = 5.0  # longest time to wait for the bridge [s]
AGAIN_S = 1.0  # time after which a request without an answer is sent again [s]
POLL_S = 0.02  # time between two looks at whether a motion is to be cancelled [s]
LIST_S = 2.0  # time between two questions for robots [s]
THREADS = 16
TRIGGERS = {
    "start": (), "stop": (), "reset": (), "step": ("steps",), "spawn": ("entity", "uri", "name", "pose"),
    "remove": ("name",), "move": ("name", "pose"), "save": ("file",), "restore": ("file",),
}  # fmt: skip
PARAMETERS = {"steps": 1, "entity": "", "uri": "", "name": "", "pose": [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], "file": ""}
QUANTITIES = ("positions", "velocities", "accelerations", "effort")


class Simulator:
    """The simulator, which answers through its bridge."""

    def __init__(self, node: Node) -> None:
        self._answers: dict[str, queue.Queue[dict[str, Any]]] = {}
        group, qos = ReentrantCallbackGroup(), QoSProfile(depth=100)
        self._requests = node.create_publisher(String, "rpbi/ros2/request", qos)
        node.create_subscription(String, "rpbi/ros2/response", self._on_response, qos, callback_group=group)

    def is_connected(self) -> bool:
        """Returns whether a bridge listens."""
        return bool(self._requests.get_subscription_count())

    def call(
        self,
        function: str,
        on_feedback: Callable[[Any], None] | None = None,
        is_cancelled: Callable[[], bool] | None = None,
        /,
        **arguments: Any,
    ) -> dict[str, Any]:
        """Calls a function of the simulator. Returns its answer, which has `success` and `message`."""
        end = time.monotonic() + CONNECT_S
        while not self.is_connected():
            if time.monotonic() > end:
                return {"success": False, "message": "no bridge answers: does the simulator run with ros2:=true?"}
            time.sleep(POLL_S)
        number = uuid.uuid4().hex
        answers = self._answers[number] = queue.Queue()
        try:
            start = time.monotonic()
            end, again = start + ANSWER_S, start
            while time.monotonic() < end:
                if time.monotonic() >= again:  # the first may come before the bridge listens; it runs each once
                    self._send(number, function, arguments)
                    again += AGAIN_S
                if is_cancelled and is_cancelled():
                    is_cancelled = None
                    self._send(number, "cancel", {})
                try:
                    answer = answers.get(timeout=POLL_S if on_feedback else AGAIN_S)
                except queue.Empty:
                    continue
                if "success" in answer:
                    return answer
                end = time.monotonic() + ANSWER_S
                if on_feedback:
                    on_feedback(answer["feedback"])
            return {"success": False, "message": f"no answer within {ANSWER_S:g} s"}
        finally:
            del self._answers[number]

    def _send(self, number: str, name: str, arguments: dict[str, Any]) -> None:
        self._requests.publish(String(data=json.dumps({"id": number, "call": name, "arguments": arguments})))

    def _on_response(self, message: String) -> None:
        answer = json.loads(message.data)
        answers = self._answers.get(answer.get("id"))
        if answers:
            answers.put(answer)


class Companion(Node):
    """Node with the services and actions."""

    def __init__(self) -> None:
        super().__init__("rpbi_companion")
        self._group = ReentrantCallbackGroup()
        for name, default in PARAMETERS.items():
            self.declare_parameter(name, default)
        self.simulator = Simulator(self)
        for name, parameters in TRIGGERS.items():
            self._serve(Trigger, name, partial(self._trigger, name, parameters))
        try:
            self._types = import_module("simulation_interfaces.srv")
            self._messages = import_module("simulation_interfaces.msg")
            self._serve_standard()
        except ImportError:
            self.get_logger().info("simulation_interfaces is not installed: services are of std_srvs only")
        self._actions: dict[str, ActionServer] = {}
        try:
            self._action_type = import_module("control_msgs.action").FollowJointTrajectory
            threading.Thread(target=self._watch_robots, daemon=True).start()
        except ImportError:
            self.get_logger().info("control_msgs is not installed: no action follow_joint_trajectory")

    def _serve(self, service_type: Any, name: str, callback: Callable[[Any, Any], Any]) -> None:
        self.create_service(service_type, f"rpbi/{name}", callback, callback_group=self._group)

    def _trigger(self, name: str, parameters: tuple[str, ...], _: Any, answer: Any) -> Any:
        values = {each: self.get_parameter(each).value for each in parameters}
        values = {each: value if isinstance(value, (str, int)) else list(value) for each, value in values.items()}
        if name == "spawn" and values["pose"] == PARAMETERS["pose"]:
            del values["pose"]  # that of the file
        given = self.simulator.call(name, **values)
        answer.success, answer.message = given["success"], given["message"]
        return answer

    # --- Services of simulation_interfaces

    def _serve_standard(self) -> None:
        served = {
            "GetSimulatorFeatures": self._features, "GetEntities": self._entities, "SpawnEntity": self._spawn,
            "DeleteEntity": self._delete, "SetEntityState": self._set_entity, "ResetSimulation": self._reset,
            "StepSimulation": self._step, "GetSimulationState": self._get_state, "SetSimulationState": self._set_state,
        }  # fmt: skip
        for name, callback in served.items():
            if hasattr(self._types, name):
                self._serve(getattr(self._types, name), re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower(), callback)

    def _finish(self, response: Any, answer: dict[str, Any]) -> Any:
        result = self._messages.Result
        response.result.result = result.RESULT_OK if answer["success"] else result.RESULT_OPERATION_FAILED
        response.result.error_message = "" if answer["success"] else answer["message"]
        return response

    def _features(self, _: Any, response: Any) -> Any:
        known = self._messages.SimulatorFeatures
        names = (
            "SPAWNING DELETING SPAWN_RESOURCE_STRING ENTITY_STATE_SETTING SIMULATION_RESET SIMULATION_RESET_STATE "
            "SIMULATION_STATE_SETTING SIMULATION_STATE_PAUSE STEP_SIMULATION_SINGLE STEP_SIMULATION_MULTIPLE"
        )
        response.features.features = [getattr(known, name) for name in names.split() if hasattr(known, name)]
        response.features.spawn_formats = ["urdf", "yaml"]
        return response

    def _entities(self, request: Any, response: Any) -> Any:
        answer = self.simulator.call("list")
        pattern = re.compile(request.filters.filter)
        response.entities = [name for name in answer.get("objects", ()) if pattern.search(name)]
        return self._finish(response, answer)

    def _spawn(self, request: Any, response: Any) -> Any:
        resource = getattr(request, "entity_resource", request)
        name = request.name or f"entity_{uuid.uuid4().hex[:8]}"
        pose = pose_of(request.initial_pose.pose)
        answer = self.simulator.call("spawn", entity=resource.resource_string, uri=resource.uri, name=name, pose=pose)
        response.entity_name = name if answer["success"] else ""
        return self._finish(response, answer)

    def _delete(self, request: Any, response: Any) -> Any:
        return self._finish(response, self.simulator.call("remove", name=request.entity))

    def _set_entity(self, request: Any, response: Any) -> Any:
        answer = self.simulator.call("move", name=request.entity, pose=pose_of(request.state.pose))
        return self._finish(response, answer)

    def _reset(self, _: Any, response: Any) -> Any:
        return self._finish(response, self.simulator.call("reset"))

    def _step(self, request: Any, response: Any) -> Any:
        return self._finish(response, self.simulator.call("step", steps=request.steps))

    def _get_state(self, _: Any, response: Any) -> Any:
        answer = self.simulator.call("state")
        states = self._messages.SimulationState
        response.state.state = states.STATE_PLAYING if answer.get("running") else states.STATE_PAUSED
        return self._finish(response, answer)

    def _set_state(self, request: Any, response: Any) -> Any:
        """Stopped is paused at the start of the world."""
        states, state = self._messages.SimulationState, request.state.state
        calls = {
            states.STATE_PLAYING: ["start"], states.STATE_PAUSED: ["stop"], states.STATE_STOPPED: ["stop", "reset"]
        }.get(state)  # fmt: skip
        if calls is None:
            return self._finish(response, {"success": False, "message": f"state {state} is not supported"})
        is_running = self.simulator.call("state").get("running")
        if is_running == (state == states.STATE_PLAYING):
            calls = calls[1:]
        answers = [self.simulator.call(name) for name in calls] or [{"success": True, "message": ""}]
        return self._finish(response, answers[-1])

    # --- Actions

    def _watch_robots(self) -> None:
        """Makes an action for each robot that appears."""
        while rclpy.ok():
            if self.simulator.is_connected():
                for robot in self.simulator.call("list").get("robots", ()):
                    if robot not in self._actions:
                        self._actions[robot] = self._serve_action(robot)
            time.sleep(LIST_S)

    def _serve_action(self, robot: str) -> ActionServer:
        self.get_logger().info(f"follow_joint_trajectory of {robot}")
        return ActionServer(
            self,
            self._action_type,
            f"rpbi/{robot}/joint_trajectory_controller/follow_joint_trajectory",
            lambda goal: self._follow(robot, goal),
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=self._group,
        )

    def _follow(self, robot: str, goal: Any) -> Any:
        request = goal.request

        def on_feedback(given: dict[str, Any]) -> None:
            feedback = self._action_type.Feedback(joint_names=given["joint_names"])
            feedback.header.stamp = self.get_clock().now().to_msg()
            for name in ("desired", "actual", "error"):
                for quantity in (each for each in QUANTITIES if each in given[name]):
                    setattr(getattr(feedback, name), quantity, given[name][quantity])
                getattr(feedback, name).time_from_start = Duration(seconds=given[name]["time_from_start_s"]).to_msg()
            goal.publish_feedback(feedback)

        answer = self.simulator.call(
            "follow",
            on_feedback,
            lambda: goal.is_cancel_requested,
            robot=robot,
            joint_names=list(request.trajectory.joint_names),
            points=[point_of(point) for point in request.trajectory.points],
            stamp_s=Time.from_msg(request.trajectory.header.stamp).nanoseconds / 1e9,
            path_tolerance=[tolerance_of(each) for each in request.path_tolerance],
            goal_tolerance=[tolerance_of(each) for each in request.goal_tolerance],
            goal_time_tolerance_s=Duration.from_msg(request.goal_time_tolerance).nanoseconds / 1e9,
        )
        if answer["success"]:
            goal.succeed()
        elif answer.get("cancelled") and goal.is_cancel_requested:
            goal.canceled()
        else:
            goal.abort()
        failed = self._action_type.Result.INVALID_GOAL
        code = answer.get("error_code", 0 if answer["success"] else failed)
        return self._action_type.Result(error_code=code, error_string=answer["message"])


def pose_of(pose: Any) -> list[float]:
    """Returns position and quaternion x, y, z, w; a quaternion of zeros is no rotation."""
    at, turn = pose.position, pose.orientation
    quat = [turn.x, turn.y, turn.z, turn.w]
    return [at.x, at.y, at.z, *(quat if any(quat) else [0.0, 0.0, 0.0, 1.0])]


def point_of(point: Any) -> dict[str, Any]:
    """Returns a point of a trajectory as a dictionary."""
    values = {name: list(getattr(point, name)) for name in QUANTITIES}
    return {**values, "time_from_start_s": Duration.from_msg(point.time_from_start).nanoseconds / 1e9}


def tolerance_of(each: Any) -> dict[str, Any]:
    """Returns the tolerance of a joint as a dictionary."""
    return {"name": each.name, **{name: getattr(each, name) for name in ("position", "velocity", "acceleration")}}


def main() -> None:
    """Runs the node."""
    rclpy.init()
    companion = Companion()
    executor = MultiThreadedExecutor(THREADS)
    executor.add_node(companion)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == "__main__":
    main()
