"""The simulator node: builds a world and opens its ROS interfaces."""

import gc
import logging
import os
import sys
import threading
from collections.abc import Callable, Sequence
from typing import Any

import pybullet
import rospy

from custom_ros_tools.errors import ConfigError, PhysicsError, Problem
from custom_ros_tools.plugins import trust_only
from custom_ros_tools.ros.lifecycle.parameters import kept_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.sockets import send_at_once
from robot_model.asset_files import ROBOT_DESCRIPTION
from robot_model.urdf.files import write_description
from rpbi.engine.priority import RealTimePriority
from rpbi.ros.publishers.sample_publishers import SamplePublishers
from rpbi.ros.publishers.transforms import StaticFrames
from rpbi.ros.publishers.world_markers import WorldMarkers
from rpbi.ros.services.node_services import NODE_SERVICES, NodeContext
from rpbi.world import World
from rpbi.world.keyframes.maker import KeyframeMaker
from rpbi.world.loading import LoadedWorld, load_world, load_world_dict
from rpbi.world.world_warnings import world_warnings

from .attachments import AttachmentPublisher
from .endpoints import serve
from .headers import use_own_frames, use_prefix
from .initial_state import start_where_robots_are
from .interface_table import endpoints
from .requests import Requests
from .services.object_lifecycle import ObjectLifecycle
from .services.prediction import MAX_TICKS, Predictor
from .services.states import state_folder
from .simulation import Simulation
from .window_topics import WindowTopics


def configured_world(robot_description: str | None) -> LoadedWorld:
    """Loads the world from the file that `~config_file` names, or from the mapping `~config` if no file is named.

    If a file is named, the keys of `~config` override keys of the file.

    Args:
        robot_description: URDF file to load wherever a configuration gives `robot_description` as the `fileName`; None
            if no URDF is supplied.

    Raises:
        ConfigError: If both parameters are missing, or the configuration is wrong; the error lists all problems.
    """
    file, config = (rospy.get_param(name, None) for name in ("~config_file", "~config"))
    if file is None and config is None:
        how = 'load it with <rosparam param="config" file="WORLD.yaml"/> inside the <node>, or name it by ~config_file'
        raise ConfigError([Problem("~config", "", f"missing: expected the main configuration; {how}")])
    if file is None:
        return load_world_dict(config, "~config", robot_description)
    if not isinstance(file, str) or not file:
        raise ConfigError([Problem("~config_file", "", f"expected a file name, got {file!r}")])
    if not isinstance(config, dict | None):
        message = f"expected a mapping of keys to values, got {type(config).__name__}"
        raise ConfigError([Problem("~config", "", message)])
    folder = str(rospy.get_param("~working_directory", "")).rstrip("\n")
    if not file.startswith(("{", "package://")):
        file = os.path.join(folder, file)
    return load_world(file, robot_description, config or {})


def _max_predicted_ticks() -> int:
    given = rospy.get_param("~max_predicted_ticks", MAX_TICKS)
    if not isinstance(given, int) or given < 1:
        raise ConfigError(
            [Problem("~max_predicted_ticks", "", f"expected a whole number of at least 1, got {given!r}")]
        )
    return given


def _wants_real_time_priority() -> bool:
    given = rospy.get_param("~real_time_priority", True)
    if not isinstance(given, bool):
        raise ConfigError([Problem("~real_time_priority", "", f"expected true or false, got {given!r}")])
    return given


def parameter_above(name: str) -> Any:
    """Searches the node's namespaces, innermost first, for a ROS parameter; returns its value, or None if not found."""
    found = rospy.search_param(name)
    if found is None:
        return None
    kept_parameters.keep(found)
    return rospy.get_param(found)


log = logging.getLogger(__name__)

LONGEST_END_S = 10.0
"""Longest wait [s] for the simulation loop and the renderer at shutdown; beyond it, ROS shuts down without them."""

SWITCH_S = 0.0005
"""Longest wait [s] of a thread for Python's global lock; Python's default, 5 ms, is five ticks at 1 kHz."""

MAX_WARNINGS = 20
"""Largest number of warnings of a world that are logged one by one at its start; further ones are only counted."""


def _log_warnings(warnings: Sequence[Problem]) -> None:
    for warning in warnings[:MAX_WARNINGS]:
        log.warning("%s", warning)
    if len(warnings) > MAX_WARNINGS:
        log.warning("%d more warnings: ./rpbi check WORLD.yaml lists all", len(warnings) - MAX_WARNINGS)


class SimulatorNode:
    """Builds the configured world and connects it to ROS.

    Raises:
        ConfigError: If the configuration is wrong; the error lists all problems.
        PhysicsError: If PyBullet cannot build the world.
    """

    def __init__(self) -> None:
        urdf = parameter_above("robot_description")
        description = None if urdf is None else write_description(urdf)
        loaded = start_where_robots_are(configured_world(description))
        config = loaded.config
        use_prefix(config.tf_prefix)
        simulated = bool(parameter_above("use_sim_time"))
        if config.real_time_factor != 1 and not simulated:
            log.warning(
                "real_time_factor is %g but /use_sim_time is not true: stamps are wall time and do not show it",
                config.real_time_factor,
            )
        self._world = World(loaded, simulated)
        endpoints(self._world)  # refuses what `./rpbi check` refuses
        _log_warnings(world_warnings(self._world))
        use_own_frames(self._world.frames())
        self._frames = StaticFrames(config.poses)
        trust_only({"rpbi", *config.trusted_packages}, "name its package in trusted_packages of the main file")
        publishers = SamplePublishers(self._world)
        for name in self._world.bodies:
            publishers.find_topics(name)
        self._cameras = publishers.cameras
        helpers: list[Callable[[], None]] = [AttachmentPublisher(self._world).poll]
        if config.markers_hz:
            helpers.append(WorldMarkers(self._world, config.markers_hz).poll)
        keyframes = KeyframeMaker(self._world, config.keyframe_every_s)
        window = WindowTopics(self._world)
        helpers += (keyframes.poll, self._cameras.poll, *window.polls)
        self._priority = RealTimePriority() if _wants_real_time_priority() else None
        self._simulation = Simulation(self._world, publishers, helpers, self._priority)
        ask = Requests(self._simulation)
        self._objects = ObjectLifecycle(self._simulation, ask, publishers)
        loading = {"search_paths": config.setAdditionalSearchPath, ROBOT_DESCRIPTION: description}
        predictor = Predictor(self._simulation, ask, _max_predicted_ticks())
        context = NodeContext(self._simulation, ask, self._objects, predictor, loading, state_folder(), keyframes)
        window.serve(ask)
        for service in NODE_SERVICES:
            serve(service, context)
        gc.collect()
        gc.freeze()  # garbage collections, which stop the loop, then skip all objects made so far
        if config.start_pybullet_after_initialization:
            self._simulation.start()

    def run(self) -> None:
        """Runs the simulation until ROS shuts down or PyBullet ends, then closes the world.

        The shutdown of ROS waits until the world is closed, for at most LONGEST_END_S.

        Raises:
            PhysicsError: If PyBullet has ended, for instance because its window was closed.
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
            if self._priority is not None:
                self._priority.end()  # while ROS shuts down, a thread of rospy spins
            has_gone = not self._world.is_connected
            send_at_once()  # buffered messages, such as the results of action goals that the shutdown has ended
            self._cameras.close()
            self._world.close()  # from here on, no object is added or removed
            # rospy's shutdown would lock up on topics that are being opened or closed, so this waits for them. Threads
            # of later additions and removals wait until the process ends.
            self._objects.end(LONGEST_END_S)
            ended.set()
        if has_gone:
            raise PhysicsError("PyBullet has ended: its window was closed, or its server has ended")


def main() -> None:
    """Runs the node; exits with code 1 if the node cannot start, and with 0 if it is interrupted."""
    sys.setswitchinterval(SWITCH_S)
    # Without ROS time: the simulator is the source of /clock and must never wait for it.
    run_node("ros_pybullet_interface", SimulatorNode, SimulatorNode.run, ros_time=False, loggers=["robot_model"])
