"""Controls a running simulator from a live view, through the simulator's services."""

from __future__ import annotations

import contextlib
import json
import subprocess
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import rospy
from cob_srvs.srv import SetString
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from custom_ros_tools.config import config_to_str
from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.wall_time import WallTimer
from robot_model.geometry import Vector
from ros_pybullet_interface.msg import PybulletObject
from ros_pybullet_interface.srv import (
    AddPybulletObject,
    ListObjects,
    ResetJointState,
    RobotInfo,
    SetJointState,
    SetRealTimeFactor,
    StepN,
)
from rpbi_data.bags.recorded_topics import Recorder

from .controls import JointRange, NewObject
from .panel import COMMANDS
from .world_topics import TopicSource

SILENCE_S = 2.5
"""Time without a message on `rpbi/state` after which the simulator counts as ended [s]."""
OBJECTS_HZ = 1.0
"""Rate of requests for the list of objects [Hz]."""
ADD_LIMIT_S = 120.0
"""Longest time to wait for an object of a file [s]."""
FOLDER = "~/rpbi_recordings"
ALSO = ("/tf", "/tf_static", "/clock", "/diagnostics")
"""Topics that are recorded in addition to those below `rpbi/`."""
IMAGES = ("/image", "/segmentation", "/pointcloud", "/compressed", "/visualizer_image", "/visualizer_image_int")
"""Endings of the names of topics that are not recorded."""


class ServiceControls:
    """Calls the services of the simulator in a namespace; see `Controls`.

    If a node `record` that records episodes runs in the namespace, it records. Otherwise, this object records a bag.

    Args:
        namespace: Namespace of the simulator, with slashes at both ends.
        source: Topics of the same simulator.
    """

    adds_files = records = True

    def __init__(self, namespace: str, source: TopicSource) -> None:
        self._namespace, self._source = namespace, source
        self._lock = threading.Lock()
        self._objects: tuple[str, ...] = ()
        self._robot, self._joint_states = "", b""
        self._subscriber: rospy.Subscriber | None = None
        self._recorder: Recorder | None = None
        self._episode = {"recording": False}
        self._label = rospy.Publisher("~label", String, queue_size=10)
        WallTimer(OBJECTS_HZ, self._ask_for_objects)
        rospy.Subscriber(f"{namespace}record/status", String, self._on_status, queue_size=1)

    @property
    def commands(self) -> Sequence[str]:
        """Names of the commands whose services are offered."""
        return [each for each in COMMANDS if self._has(f"rpbi/{each.lower()}")]

    def status(self) -> str:
        """Returns the state of the world, with its time and its real-time factor."""
        state = self._source.state
        if state is None or self._source.state_age_s > SILENCE_S:
            return "no simulator"
        if not (state.running or state.stepping):
            return f"stopped at {state.simulated_time:.2f} s"
        return f"{state.simulated_time:.1f} s, real-time factor {state.real_time_factor:.3f}"

    def run(self, command: str) -> str:
        """Calls the service of a command."""
        return str(self._call(f"rpbi/{command.lower()}", Trigger).message)

    def step(self, ticks: int) -> str:
        """Runs ticks of a stopped world, as fast as possible."""
        return str(self._call("rpbi/step_n", StepN, ticks).message)

    def factor(self) -> float | None:
        """Returns the requested real-time factor."""
        return None if self._source.state is None else float(self._source.state.real_time_factor_asked)

    def set_factor(self, factor: float) -> str:
        """Changes the real-time factor."""
        return str(self._call("rpbi/set_real_time_factor", SetRealTimeFactor, factor).message)

    def robots(self) -> Sequence[str]:
        """Returns the names of all robots."""
        start, end = f"{self._namespace}rpbi/", "/robot_info"
        services = self._source.table.state.providers
        return sorted(
            name.removeprefix(start).removesuffix(end)
            for name in services
            if name.startswith(start) and name.endswith(end)
        )

    def joints(self, robot: str) -> Sequence[JointRange]:
        """Returns the movable joints of a robot."""
        info = self._call(f"rpbi/{robot}/robot_info", RobotInfo)
        return [
            JointRange.of(each.jointName, each.jointLowerLimit, each.jointUpperLimit, each.is_revolute)
            for each in info.joint_info
            if not each.is_fixed
        ]

    def positions(self, robot: str) -> Mapping[str, float]:
        """Returns the positions in the newest message of a robot; none before its first message."""
        if robot != self._robot:
            if self._subscriber is not None:
                self._subscriber.unregister()
            self._robot, self._joint_states = robot, b""
            # bytes: joint states of 1 kHz would cost much time if each were decoded
            topic = f"{self._namespace}rpbi/{robot}/joint_states"
            self._subscriber = rospy.Subscriber(topic, rospy.AnyMsg, self._on_joint_states, robot, queue_size=1)
        if not self._joint_states:
            return {}
        message = JointState()
        message.deserialize(self._joint_states)
        return dict(zip(message.name, message.position))

    def move(self, robot: str, positions: Mapping[str, float], duration_s: float) -> str:
        """Moves joints. A visual robot, which has no motors, takes the positions at once."""
        state = JointState(name=[*positions], position=[*positions.values()])
        if self._has(f"rpbi/{robot}/move_to_joint_state"):
            return str(self._call(f"rpbi/{robot}/move_to_joint_state", ResetJointState, state, duration_s).message)
        return str(self._call(f"rpbi/{robot}/set_joint_state", SetJointState, state).message)

    def home(self, robot: str, duration_s: float) -> str:
        """Moves all joints to where they started."""
        service = f"rpbi/{robot}/move_to_initial_joint_state"
        return str(self._call(service, ResetJointState, JointState(), duration_s).message)

    def halt(self, robot: str) -> str:
        """Ends a motion of a robot."""
        return str(self._call(f"rpbi/{robot}/stop_motion", Trigger).message)

    def objects(self) -> Sequence[str]:
        """Returns the names of all objects and cameras, as a thread that may hang with the simulator knows them."""
        return self._objects

    def add(self, primitive: NewObject) -> str:
        """Adds a primitive as a dynamic object."""
        asked = PybulletObject(object_type=PybulletObject.DYNAMIC, config=config_to_str(primitive.config()))
        return str(self._call("rpbi/add_pybullet_object", AddPybulletObject, asked).message)

    def add_file(self, file: str, name: str, position: Vector) -> str:
        """Adds the object of a file, as the command `spawn` does."""
        if not file or file.startswith("-") or name.startswith("-"):
            raise InterfaceError("expected the name of a file, and names that do not begin with '-'")
        words = ["rosrun", "rpbi_utils", "world", "spawn", file, "--ns", self._namespace, "--at", *map(str, position)]
        words += ["--name", name] if name else []
        try:
            done = subprocess.run(words, capture_output=True, text=True, timeout=ADD_LIMIT_S, stdin=subprocess.DEVNULL)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise InterfaceError(f"{file} is not added: {error}") from None
        if done.returncode:
            raise InterfaceError(done.stderr.strip().removeprefix("spawn: ") or f"{file} is not added")
        return done.stdout.strip()

    def remove(self, name: str) -> str:
        """Removes an object or a camera."""
        return str(self._call("rpbi/remove_pybullet_object", SetString, name).message)

    @property
    def is_recording(self) -> bool:
        """Whether this object records a bag, or the node `record` records an episode."""
        return self._recorder is not None or bool(self._episode["recording"])

    def record(self, label: str) -> str:
        """Starts an episode of the node `record`; without such a node, starts a bag."""
        if self._has("record/start"):
            text = self._call("record/start", Trigger).message
            return f"{text}; {self._call('record/label', SetString, label).message}" if label else str(text)
        with self._lock:
            if self._recorder is not None:
                raise InterfaceError("a recording runs already")
            stem = "_".join([*label.split(), time.strftime("%Y%m%d_%H%M%S")]).replace("/", "_")
            recorder = Recorder(Path(FOLDER).expanduser() / f"{stem}.bag", self._recorded_topics())
            recorder.start()
            self._recorder = recorder
        return f"{recorder.path} is being recorded"

    def end_recording(self) -> str:
        """Ends the bag or the episode."""
        with self._lock:
            if self._recorder is None:
                return str(self._call("record/stop", Trigger).message)
            recorder, self._recorder = self._recorder, None
            return f"saved {recorder.stop()}"

    def label(self, label: str) -> str:
        """Labels the episode of the node `record`; in a bag, publishes the label at the present moment."""
        if self._has("record/label") and self._recorder is None:
            return str(self._call("record/label", SetString, label).message)
        if self._recorder is None:
            raise InterfaceError("nothing is being recorded")
        self._label.publish(label)
        return label

    def _recorded_topics(self) -> list[str]:
        ours = f"{self._namespace}rpbi/"
        names = [*self._source.table.rows, self._label.resolved_name]
        return [
            name
            for name in names
            if (name.startswith(ours) and not name.endswith(IMAGES)) or name in (*ALSO, self._label.resolved_name)
        ]

    def _ask_for_objects(self) -> None:
        names: tuple[str, ...] = ()
        if self._has("rpbi/list_objects"):
            with contextlib.suppress(InterfaceError):
                names = tuple(self._call("rpbi/list_objects", ListObjects).names)
        self._objects = names

    def _on_status(self, message: String) -> None:
        with contextlib.suppress(ValueError):
            self._episode = {"recording": False, **json.loads(message.data)}

    def _on_joint_states(self, message: Any, robot: str) -> None:
        if robot == self._robot:
            self._joint_states = message._buff

    def _has(self, service: str) -> bool:
        return f"{self._namespace}{service}" in self._source.table.state.providers

    def _call(self, service: str, kind: type, *arguments: object) -> Any:
        name = f"{self._namespace}{service}"
        try:
            answer = rospy.ServiceProxy(name, kind)(*arguments)
        except (rospy.ServiceException, rospy.ROSException, rospy.ROSSerializationException, OSError) as error:
            raise InterfaceError(f"{name} does not answer: {error}") from None
        if not getattr(answer, "success", True):
            raise InterfaceError(answer.message)
        return answer
