"""`scene_node.py`: runs a scene in the simulator through topics and services, one episode for each seed."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from itertools import count
from typing import Any

import numpy as np
import rospy
from apriltag_ros.msg import AprilTagDetectionArray
from cob_srvs.srv import SetString
from custom_srvs.srv import SetTransform
from geometry_msgs.msg import Point, Vector3, Wrench, WrenchStamped
from nav_msgs.msg import Odometry
from pydantic import Field
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from custom_ros_tools import schema
from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.end_launch import end_launch
from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.services import get_srv_handler
from custom_ros_tools.ros.tf_interface import TfInterface
from custom_ros_tools.ros.transform_messages import as_pose, transform_message
from custom_ros_tools.schema import ConfigModel, Count, NonNegative, Text
from robot_model.geometry import Pose, Vector, plus, scaled
from ros_pybullet_interface.msg import Contacts, PlannedInput
from ros_pybullet_interface.srv import ApplyWrench, ChangeDynamics, GetStateHash, StepWithInputs, SwitchControllers
from rpbi.ros.services.prediction import POSE_NAMES
from rpbi.ros.tick_listener import TickListener

from . import SCENES
from .scene import (
    Change,
    GainChange,
    InputValue,
    Scene,
    SceneResult,
    Seen,
    SeenWrench,
    Shove,
    Stage,
    Switch,
    Teleport,
    Touch,
    Watched,
    WorldChange,
    broken_off,
    run_scene,
    tag_in_world,
)

PATIENCE_S = 20.0
"""Timeout for the messages of a tick, in wall time [s]."""
WORLD = "rpbi/world"
LATE_S = 0.1
"""Largest delay behind the desired real-time factor that later cycles make up for [s]."""
NODE = "scene"


class SimulatorStage(Stage):
    """Steps the simulator, and waits for the messages from which the scene observes the world.

    Since the simulator waits for the scene, the same seed leads to the same episode on any computer. When ROS shuts
    down, all methods raise a ROSInterruptException.

    Args:
        watch: Robots, bodies and sensors that the scene observes.
        ticks: Number of ticks in a cycle.
        real_time_factor: Largest ratio of simulated time to wall time. 0: as fast as possible.
    """

    def __init__(self, watch: Watched, ticks: int, real_time_factor: float) -> None:
        self._watch, self._ticks, self._factor = watch, ticks, real_time_factor
        self._services: dict[str, Any] = {}
        self._inputs: list[PlannedInput] = []
        self._begin_s = self._due_s = 0.0
        self._scene: Scene | None = None
        topics: dict[str, type] = {f"rpbi/{name}/joint_states": JointState for name in watch.robots}
        topics |= {f"rpbi/{name}/base_state": Odometry for name in watch.bodies}
        topics |= {f"rpbi/{name}/ft_sensor": WrenchStamped for name in watch.wrenches}
        topics |= {f"rpbi/{name}/contacts": Contacts for name in watch.contacts}
        topics |= {topic: AprilTagDetectionArray for topic in watch.tags}
        self._listener = TickListener(topics)
        self._tf = TfInterface() if watch.tags else None
        self._cameras: dict[str, Pose] = {}
        before, after = (self._step(ticks).stamp.to_sec() for ticks in (0, 1))
        self._dt_s = round(after - before, 9)

    def begin(self, scene: Scene) -> None:
        """Resets the world, and prepares an episode of a scene."""
        self._ask("rpbi/reset", Trigger)
        self._scene, self._begin_s = scene, time.monotonic()
        self._due_s = self._begin_s
        scene.prepare()
        for change in scene.take_changes():
            self.do(change)

    def do(self, change: WorldChange) -> None:
        if isinstance(change, InputValue):
            self._inputs.append(_input(change))
        elif isinstance(change, Teleport):
            self._ask(f"rpbi/{change.name}/set_pose", SetTransform, transform_message(*change.pose))
        elif isinstance(change, Shove):
            force = Wrench(force=Vector3(*change.force))
            self._ask("rpbi/apply_wrench", ApplyWrench, change.target, force, Point(), "", change.duration_s)
        elif isinstance(change, Change):
            self._ask("rpbi/change_dynamics", ChangeDynamics, change.target, json.dumps(change.values))
        elif isinstance(change, Switch):
            self._ask(f"rpbi/{change.robot}/switch_controllers", SwitchControllers, change.start, change.stop)
        elif isinstance(change, GainChange):
            self._ask(f"rpbi/{change.target}/set_gains", SetString, json.dumps(change.values))
        else:
            self._ask("rpbi/remove_pybullet_object", SetString, change.name)

    def cycle(self) -> None:
        answer = self._step(self._ticks)
        assert self._scene is not None
        try:
            found = self._listener.wait_for_tick(answer.stamp, PATIENCE_S)
        except TimeoutError as error:
            _raise_if_shut_down()
            raise InterfaceError(str(error)) from None
        self._scene.look(self._seen(answer.tick * self._dt_s, found))
        if self._factor:
            self._due_s = max(self._due_s + self._ticks * self._dt_s / self._factor, time.monotonic() - LATE_S)
            time.sleep(max(0.0, self._due_s - time.monotonic()))
        _raise_if_shut_down()

    def reached_factor(self) -> float:
        """Returns the ratio of simulated time to wall time in this episode."""
        assert self._scene is not None
        return self._scene.seen.time_s / (time.monotonic() - self._begin_s)

    def state_hash(self) -> str:
        """Returns the hash of the world's state, which the simulator computes."""
        return str(self._ask("rpbi/get_state_hash", GetStateHash).state_hash)

    def _step(self, ticks: int) -> Any:
        inputs, self._inputs = self._inputs, []
        return self._ask("rpbi/step_with_inputs", StepWithInputs, ticks, inputs)

    def _ask(self, name: str, kind: type, *arguments: Any) -> Any:
        if name not in self._services:
            self._services[name] = get_srv_handler(name, kind, persistent=True)
        answer = self._services[name](*arguments)
        if not answer.success:
            _raise_if_shut_down()
            raise InterfaceError(f"{name}: {answer.message}")
        return answer

    def _seen(self, time_s: float, found: Mapping[str, Any]) -> Seen:
        watch = self._watch
        joints = {name: found[f"rpbi/{name}/joint_states"] for name in watch.robots}
        wrenches = {name: found[f"rpbi/{name}/ft_sensor"].wrench for name in watch.wrenches}
        return Seen(
            time_s,
            {name: dict(zip(state.name, state.position)) for name, state in joints.items()},
            {name: _pose(found[f"rpbi/{name}/base_state"].pose.pose) for name in watch.bodies},
            {name: SeenWrench(_vector(each.force), _vector(each.torque)) for name, each in wrenches.items()},
            {name: tuple(map(_touch, found[f"rpbi/{name}/contacts"].points)) for name in watch.contacts},
            {
                detection.id[0]: tag_in_world(
                    self._camera(found[topic].header.frame_id), _pose(detection.pose.pose.pose)
                )
                for topic in watch.tags
                for detection in found[topic].detections
            },
        )

    def _camera(self, frame: str) -> Pose:
        """Looks up the pose of a static camera frame in the world on TF. Each frame is looked up only once."""
        if frame not in self._cameras:
            assert self._tf is not None
            message = self._tf.wait_for_tf_msg(WORLD, frame, PATIENCE_S)
            if message is None:
                raise InterfaceError(f"no TF of the camera from '{WORLD}' to '{frame}' within {PATIENCE_S:g} s")
            self._cameras[frame] = _pose(as_pose(message.transform))
        return self._cameras[frame]


def _raise_if_shut_down() -> None:
    if rospy.core.is_shutdown_requested():
        raise rospy.ROSInterruptException("ROS shuts down")


def _input(change: InputValue) -> PlannedInput:
    value = change.value
    if isinstance(value, Pose):
        return PlannedInput(0, change.slot, POSE_NAMES, (*value.position, *value.quat_xyzw))
    return PlannedInput(0, change.slot, tuple(value), tuple(value.values()))


def _pose(message: Any) -> Pose:
    turn = message.orientation
    return Pose(_vector(message.position), (turn.x, turn.y, turn.z, turn.w))


def _vector(message: Any) -> Vector:
    return message.x, message.y, message.z


def _touch(point: Any) -> Touch:
    place, normal = _vector(point.position), _vector(point.normal)
    first = scaled(point.friction_force_1, _vector(point.friction_direction_1))
    second = scaled(point.friction_force_2, _vector(point.friction_direction_2))
    force = plus(scaled(point.normal_force, normal), plus(first, second))
    return Touch(point.other_body, point.other_link, place, normal, point.normal_force, force)


class SceneNodeConfig(ConfigModel):
    """Private parameters of `scene_node.py`."""

    scene: Text = Field(description="Scene: a name in `SCENES`, or `module:Class`.")
    seed: Count = Field(1, description="Seed of the first episode; the seed increases by 1 with each episode.")
    episodes: Count = Field(0, description="Number of episodes; 0 runs episodes until the node is stopped.")
    noise: schema.Switch = Field(False, description="Whether measured poses have noise and delay.")
    real_time_factor: NonNegative = Field(
        1.0, description="Simulated seconds per second of wall time; 0 runs as fast as possible."
    )


def _run() -> None:
    config = private_parameters(SceneNodeConfig)
    kind = SCENES.find(config.scene)
    stage = SimulatorStage(kind.watch, kind.cycle_ticks, config.real_time_factor)
    succeeded = 0
    for number, seed in enumerate(count(config.seed), 1):
        scene = kind(np.random.default_rng(seed))
        scene.is_noisy = config.noise
        rospy.loginfo("seed %d", seed)
        stage.begin(scene)
        try:
            result = run_scene(scene, stage)
        except InterfaceError as error:  # the reset for the next episode may remove the cause
            result = broken_off(scene, error)
        succeeded += result.success
        _report(seed, result, stage)
        if number == config.episodes:
            rospy.loginfo("%d of %d episodes succeeded", succeeded, number)
            end_launch("all episodes are done")
            break


def _report(seed: int, result: SceneResult, stage: SimulatorStage) -> None:
    """Logs the result of an episode in one line."""
    verdict = "succeeded" if result.success else f"failed: {result.reason}" if result.reason else "failed"
    parts = [f"{name}: {value:.4g}" for name, value in result.figures.items()]
    parts += [f"real-time factor: {stage.reached_factor():.3f}", f"state: {stage.state_hash()}"]
    say = rospy.loginfo if result.success else rospy.logwarn
    say("seed %d %s, after %.2f s; %s", seed, verdict, result.time_s, ", ".join(parts))


def main() -> None:
    """Runs the node."""
    run_node(NODE, _run, loggers=("rpbi_examples",))
