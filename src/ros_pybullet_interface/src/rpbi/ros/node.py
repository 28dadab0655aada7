"""The simulator node: a world with ROS around it."""

from __future__ import annotations

import logging
import sys
import threading
from collections.abc import Callable, Mapping
from typing import Any

import pybullet
import rospy

from custom_ros_tools.errors import ConfigError, InterfaceError, PhysicsError, Problem, UnknownNameError
from custom_ros_tools.ros.interrupts import leaving_ros_on_interrupt, wait_for_master
from custom_ros_tools.ros.kept_parameters import kept_parameters
from custom_ros_tools.ros.last_words import log_last_words, log_loss_of_master
from custom_ros_tools.ros.logging_bridge import attach_logging
from custom_ros_tools.ros.master_watch import MasterWatch

from ..asset_files import ROBOT_DESCRIPTION
from ..bodies import BODY_TYPES
from ..config import load_world_dict
from ..inputs import PoseInput
from ..rgbd_config import RgbdSensorConfig
from ..samples import LinkPoseSample, SceneSample
from ..sensors import RgbdSensor
from ..urdf import write_description
from ..world import World
from .body_endpoints import BodyEndpoints
from .camera_outlet import CameraOutlet
from .camera_services import CameraServices
from .dynamics_services import DynamicsServices
from .frames import use_prefix
from .initial_state import start_where_robots_are, with_initial_state
from .inputs import Inputs, topic_input
from .outlets import TOPICS, Outlet, SampleOutlet, sample_topic
from .requests import Requests
from .services import NodeServices
from .simulation import Simulation
from .status import FREE_RUNNING_CLOCK_HZ, ClockOutlet
from .time_services import TimeServices
from .topics import FastTopic
from .transform_outlet import TransformOutlet
from .window_topics import WindowTopics
from .world_markers import WorldMarkers

log = logging.getLogger(__name__)

MAX_CLOCK_HZ = 1000.0
LONGEST_END_S = 10.0
"""How long ROS waits for the loop and the renderer before it shuts down without them [s]."""

# A thread that waits for Python's lock gets it after this long at most [s]; Python's own 5 ms are five ticks at 1 kHz.
sys.setswitchinterval(0.0005)


class SimulatorNode:
    """Builds the world of `~config` and connects everything in it to ROS.

    Raises:
        ConfigError: If the configuration is wrong; it tells everything that is.
        PhysicsError: If PyBullet cannot do what is asked.
    """

    def __init__(self) -> None:
        MasterWatch()
        description = _robot_description()
        loaded = load_world_dict(_config_parameter(), "~config", BODY_TYPES, description)
        loaded = start_where_robots_are(loaded)
        config = loaded.config
        use_prefix(config.tf_prefix)
        simulated = bool(_parameter_above("use_sim_time", False))
        if config.real_time_factor != 1 and not simulated:
            log.warning(
                "real_time_factor is %g but /use_sim_time is not true: stamps are wall time and tell nothing of it",
                config.real_time_factor,
            )
        self._world = World(loaded, simulated)
        self._topics = {sample_type: SampleOutlet() for sample_type in TOPICS}
        self._transforms = TransformOutlet()
        self._outlets: dict[type, Outlet] = {**self._topics, LinkPoseSample: self._transforms}
        self._cameras = self._outlets[SceneSample] = CameraOutlet(self._world)
        for name in self._world.bodies:
            self._find_topics(name)
        clock = ClockOutlet(self._world.clock, _clock_hz(config)) if simulated else None
        helpers: list[Callable[[], None]] = []
        if config.markers_hz:
            helpers.append(WorldMarkers(self._world, config.markers_hz).poll)
        window = WindowTopics(self._world)
        helpers += (self._cameras.poll, *window.polls)
        self._simulation = Simulation(
            self._world,
            self._outlets,
            config.real_time_factor,
            config.status_hz,
            clock,
            helpers,
            self._cameras.facts,
            self._cameras.before_tick,
        )
        self._inputs = Inputs(self._world)
        self._ask = Requests(self._simulation)
        self._endpoints = BodyEndpoints(self._world, self._simulation, self._ask)
        self._objects_lock = threading.Lock()  # one object comes or goes at a time
        self._placed_cameras: Mapping[str, RgbdSensor] = {}
        self._place_cameras()
        for name in self._world.bodies:
            self._open(name)
        context = {"search_paths": config.search_paths(), ROBOT_DESCRIPTION: description}
        NodeServices(self._simulation, self._ask, self._add, self._remove, context)
        CameraServices(self._add_camera, config.search_paths())
        DynamicsServices(self._world, self._ask)
        window.serve(self._ask)
        TimeServices(self._simulation, self._ask, self._reset)
        if config.start_pybullet_after_initialization:
            self._simulation.start()

    def run(self) -> None:
        """Simulates until ROS shuts down, which waits until everything here has ended in good order.

        Raises:
            PhysicsError: If PyBullet has gone before, for instance because its window was closed.
        """
        ended = threading.Event()
        ended.set()
        rospy.on_shutdown(lambda: ended.wait(LONGEST_END_S))  # called at once if ROS has shut down already
        ended.clear()
        try:
            self._simulation.run(lambda: rospy.core.is_shutdown_requested() or not self._world.is_connected)
        except pybullet.error:
            if self._world.is_connected:
                raise
        finally:
            has_gone = not self._world.is_connected
            self._cameras.close()
            self._world.close()  # from here on, no object comes or goes
            # Topics that are just being opened or closed would lock rospy up. Who waits for them ends with the process.
            self._objects_lock.acquire(timeout=LONGEST_END_S)
            ended.set()
        if has_gone:
            raise PhysicsError("PyBullet has gone: its window was closed, or its server has ended")

    def _add(self, kind: str, config: Any, file: str) -> None:
        with self._objects_lock:
            config = with_initial_state(config, file)
            self._ask(lambda: self._take_in(kind, config, file))
            try:
                self._open(config.name)
            except Exception as error:
                self._withdraw(config.name)
                raise InterfaceError(f"{config.name}: its topics could not be opened: {error}") from error

    def _take_in(self, kind: str, config: Any, file: str) -> None:
        """Does the simulation thread's part of it."""
        self._world.add(kind, config, file)
        try:
            self._find_topics(config.name)
        except InterfaceError:
            self._world.remove(config.name)
            raise

    def _find_topics(self, name: str) -> None:
        """Finds the topics of a body before its first sample, those that other packages name too."""
        for sensor in self._world.sensors_of(name):
            if sample_topic(sensor) is not None and sensor.sample_type not in self._topics:
                self._topics[sensor.sample_type] = self._outlets[sensor.sample_type] = SampleOutlet()
        for key, taken in self._world.bodies[name].inputs().items():
            if not isinstance(taken, PoseInput):
                topic_input(key, taken)

    def _add_camera(self, config: RgbdSensorConfig, file: str) -> None:
        with self._objects_lock:
            self._ask(lambda: self._world.add_camera(config, file))
            self._place_cameras()

    def _place_cameras(self) -> None:
        """Follows the TF frames of the cameras that there are now, and no others."""
        cameras = self._world.cameras
        for name, camera in self._placed_cameras.items():
            if cameras.get(name) is not camera:
                self._inputs.close(name)
        for name, camera in cameras.items():
            if self._placed_cameras.get(name) is not camera:
                self._inputs.open(name, camera.inputs())
        self._placed_cameras = cameras

    def _remove(self, name: str) -> None:
        with self._objects_lock:
            if name in self._world.cameras:
                self._ask(lambda: self._world.remove(name))
                self._place_cameras()
            elif name in self._world.bodies:
                self._withdraw(name)
            else:
                raise UnknownNameError("object", name, [*self._world.bodies, *self._world.cameras])

    def _reset(self) -> None:
        """Makes the world what it was; what ROS has of bodies that were there all the time stays open."""
        with self._objects_lock:
            for name in self._ask(self._world.changed_names):
                self._inputs.close(name)
            changed, topics, error = self._ask(self._start_again)
            for topic in topics:
                topic.close()
            for name in changed:
                self._endpoints.close(name)
            for name in self._world.bodies:
                if name in changed:
                    self._open(name)
            self._place_cameras()
            if error is not None:
                raise error

    def _start_again(self) -> tuple[set[str], list[FastTopic], InterfaceError | None]:
        """Does the simulation thread's part of it; returns what is left to open and close, and what went wrong."""
        changed = self._world.changed_names()
        topics = [topic for name in changed & self._world.bodies.keys() for topic in self._take_out(name)]
        try:
            self._simulation.reset(self._inputs.repeat_poses)
        except InterfaceError as error:
            return changed, topics, error
        return changed, topics, None

    def _open(self, name: str) -> None:
        """Opens the topics and services of a body."""
        body = self._world.bodies[name]
        self._inputs.open(name, body.inputs())
        for sensor in self._world.sensors_of(name):
            topic = sample_topic(sensor)
            if topic is not None:
                self._topics[sensor.sample_type].open(sensor.name, topic)
        self._endpoints.open(body)

    def _withdraw(self, name: str) -> None:
        """Takes a body out of the world, and all that belongs to it from ROS; its inputs first."""
        self._inputs.close(name)
        for topic in self._ask(lambda: self._take_out(name)):
            topic.close()
        self._endpoints.close(name)

    def _take_out(self, name: str) -> list[FastTopic]:
        """Does the simulation thread's part of it; returns the topics that are left to close."""
        sensors = self._world.sensors_of(name) if name in self._world.bodies else []
        self._world.remove(name)
        self._transforms.forget(name)
        outlets = [(self._topics.get(each.sample_type), each.name) for each in sensors]
        topics = [outlet.forget(sensor) for outlet, sensor in outlets if outlet is not None]
        return [topic for topic in topics if topic is not None]


def main() -> None:
    """Runs the node; exits with 1 if it cannot start, with 0 when it is interrupted."""
    if not wait_for_master():
        return
    # Without ROS time: the simulator is the source of /clock and must never wait for it.
    rospy.init_node("ros_pybullet_interface", disable_rostime=True, disable_signals=True)
    attach_logging("rpbi", "custom_ros_tools")
    try:
        node = SimulatorNode()
    except InterfaceError as error:
        log_last_words(str(error).splitlines())
        sys.exit(1)
    except ConnectionError as error:
        log_loss_of_master(error)
        sys.exit(1)
    with leaving_ros_on_interrupt():
        try:
            node.run()
        except PhysicsError as error:
            log_last_words([str(error)])
            sys.exit(1)


def _config_parameter() -> dict[str, Any]:
    config = rospy.get_param("~config", None)
    if config is None:
        how = 'load it with <rosparam param="config" file="WORLD.yaml"/> inside the <node>'
        raise ConfigError([Problem("~config", "", f"missing: expected the main configuration; {how}")])
    return config


def _robot_description() -> str | None:
    """Returns a file with the robot description of the parameter server, None if there is none."""
    text = _parameter_above("robot_description", None)
    return None if text is None else write_description(text)


def _parameter_above(name: str, default: Any) -> Any:
    """Returns a parameter of this namespace or, failing that, of the nearest one around it."""
    found = rospy.search_param(name)
    if found is None:
        return default
    kept_parameters.keep(found)
    return rospy.get_param(found)


def _clock_hz(config: Any) -> float:
    if not config.real_time_factor:
        limit = FREE_RUNNING_CLOCK_HZ
    else:
        limit = min(config.real_time_factor / config.timeStep, MAX_CLOCK_HZ)
    return min(config.clock_hz or limit, limit)
