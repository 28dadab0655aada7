"""The bodies, cameras and attachments of a world, and the load log from which the world can be rebuilt."""

import hashlib
import struct
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from custom_ros_tools.errors import ConfigError, InterfaceError, PhysicsError, PluginError, Problem, UnknownNameError
from rpbi.bodies import Body, BodyConfig
from rpbi.config.pybullet_models import ChangeDynamics
from rpbi.config.pybullet_world_models import PhysicsChange
from rpbi.config.sensors import FIRST_TOPIC_NAME, RgbdSensorConfig
from rpbi.config.world import WorldConfig
from rpbi.control.pose_follower import PoseFollower
from rpbi.engine.client import Client
from rpbi.engine.clock import Clock
from rpbi.engine.inputs import Input
from rpbi.geometry import Pose
from rpbi.plugins import plugin_errors
from rpbi.sensors import SENSOR_TYPES
from rpbi.sensors.contacts.contacts import ContactReader
from rpbi.sensors.rgbd import RgbdSensor
from rpbi.sensors.sensor import SensedWorld, Sensor

from .attachments import Attachments
from .load_log import LogEntry, apply
from .loading import LoadedWorld
from .saved.recipe import Recipe
from .sensor_schedule import SensorSchedule

DIGEST_BYTES = 16


def state_hash(tick: int, bodies: Mapping[str, Body]) -> str:
    """Returns a BLAKE2b hash of the tick, the bodies' names, and the positions and velocities of bodies and joints.

    Equal states have equal hashes in all processes: names are sorted, and numbers are hashed as bytes. Motor targets
    are not hashed, since different targets soon lead to different motion. The motion of soft bodies is not hashed,
    since this motion is not reproducible.
    """
    digest = hashlib.blake2b(struct.pack("<Q", tick), digest_size=DIGEST_BYTES)
    for name in sorted(bodies):
        numbers = bodies[name].motion_state()
        digest.update(name.encode() + b"\0" + struct.pack(f"<{len(numbers)}d", *numbers))
    return digest.hexdigest()


def sensors_and_inputs(body: Body, config: BodyConfig) -> tuple[tuple[Sensor, ...], Mapping[str, Input]]:
    """Returns a body's sensors and its inputs.

    Returns:
        The sensors, first the body's built-in sensors and then the configured sensors; and the inputs, indexed by name.

    Raises:
        PluginError: If a class of another package fails.
    """
    with plugin_errors(body, f"sensors and inputs of '{body.name}'"):
        sensors, inputs = body.sensors(), body.inputs()
    return (*sensors, *(_make(body, each) for each in config.sensors)), inputs


def _make(body: Body, config: Any) -> Sensor:
    sensor_type: Any = SENSOR_TYPES.find(config.type)
    with plugin_errors(sensor_type, f"making '{body.name}/{config.name}'"):
        return sensor_type(body, config)


class WorldContents:
    """The bodies and cameras of a world with their sensors and inputs, and the world's load log.

    Attributes:
        bodies: Bodies, indexed by name.
        stepping: Bodies and pose followers whose `before_step` is called before each tick.
        cameras: Cameras, indexed by name; each change creates a new dictionary.
        inputs: Inputs, indexed by slot (`NAME/INPUT`); each change creates a new dictionary.
        sensors: Schedule of all sensors.
        contacts: Reader of the contacts between bodies.
        attachments: Attachments between bodies.
        log: Load log: all changes of bodies and physics, from which the world can be rebuilt.
    """

    def __init__(self, pb: Client, clock: Clock, world: SensedWorld) -> None:
        self._pb = pb
        self._clock = clock
        self._world = world
        self.bodies: dict[str, Body] = {}
        self.stepping: list[Body | PoseFollower] = []
        self.cameras: dict[str, RgbdSensor] = {}
        self.inputs: dict[str, Input] = {}
        self.sensors = SensorSchedule(clock)
        self.contacts = ContactReader(pb, self.bodies)
        self.attachments = Attachments(pb, self.bodies)
        self.log: list[LogEntry] = []
        self._config = WorldConfig()
        self._filled_entries = 0
        """Number of log entries that the last `fill` or `rebuild` made."""
        self._changed: set[str] = set()
        """Names of bodies that had been added or removed before the last `rebuild`."""

    def body(self, name: str) -> Body:
        """Returns the body with a given name.

        Raises:
            UnknownNameError: If there is no such body.
        """
        if name not in self.bodies:
            raise UnknownNameError("object", name, list(self.bodies))
        return self.bodies[name]

    def add(self, kind: str, config: BodyConfig, file: str | None = None) -> Body:
        """Adds a body, see `World.add`."""
        name = config.name
        self._require_new(name, file)
        try:
            self._append(LogEntry(name, "add", (kind, config)))
            body = self.bodies[name]
            try:
                self._take_in(body, config)
            except Exception:
                self._append(LogEntry(name, "remove"))
                raise
        except ConfigError as error:
            raise ConfigError([Problem(file or name, each.key, each.message) for each in error.problems]) from None
        if body.object_tf is not None and (pose := self._config.pose_of(body.object_tf.tf_id)) is not None:
            body.teleport(pose)
        return body

    def add_camera(self, config: RgbdSensorConfig, file: str | None = None) -> RgbdSensor:
        """Adds a camera, see `World.add_camera`."""
        self._require_new(config.name, file)
        taken = {camera.topic_name for camera in self.cameras.values()}
        topic_name = config.name if FIRST_TOPIC_NAME in taken else FIRST_TOPIC_NAME
        if topic_name in taken:
            message = f"topics of the first camera are named '{topic_name}'; use another name"
            raise ConfigError([Problem(file or config.name, "name", message)])
        camera = RgbdSensor(config, self.bodies, self._clock, topic_name)
        self._insert_camera(camera)
        return camera

    def remove(self, name: str) -> None:
        """Removes a body or a camera.

        Raises:
            UnknownNameError: If no body or camera has this name.
        """
        if name in self.cameras:
            self.cameras = {other: camera for other, camera in self.cameras.items() if other != name}
        else:
            self.attachments.release_body(name)
            self._append(LogEntry(name, "remove"))
            self.stepping[:] = [each for each in self.stepping if each.name != name]
        self.sensors.remove(name)
        self.inputs = {slot: each for slot, each in self.inputs.items() if slot.split("/")[0] != name}

    def change_dynamics(self, name: str, link: str, change: ChangeDynamics) -> None:
        """Changes the dynamics of a link, see `World.change_dynamics`.

        Args:
            name: Name of the body.
            link: Name of the link; empty for the root link.
            change: New values of dynamics.
        """
        self._append(LogEntry(name, "dynamics", (link, change)))

    def change_physics(self, change: PhysicsChange) -> None:
        """Changes gravity, or parameters of PyBullet's engine; see `World.change_physics`."""
        self._append(LogEntry("", "physics", change))

    def clear(self) -> None:
        """Removes attachments, bodies, scheduled sensors and all entries of the load log.

        Keeps cameras and inputs; the next call of `fill` or `rebuild` updates them.
        """
        self.attachments.clear()
        for body in self.bodies.values():
            body.remove()
        self.bodies.clear()
        self.stepping.clear()
        self.sensors.clear()
        self.log.clear()
        self.contacts.invalidate()

    def fill(self, loaded: LoadedWorld) -> None:
        """Adds all configured objects, attachments and cameras, after `clear`.

        Configured cameras that already exist keep their present poses. Other existing cameras are removed.

        Raises:
            ConfigError: If objects, attachments or cameras cannot be added; all others are added nevertheless.
        """
        inputs_before = self.inputs
        self._config = loaded.config
        self._append(LogEntry("", "world", loaded.config))
        problems: list[Problem] = []
        for item in loaded.objects:
            try:
                self.add(item.type, item.config, item.file)
            except ConfigError as error:
                problems += error.problems
            except (PhysicsError, PluginError) as error:
                problems.append(Problem(item.file, "", str(error)))
        problems += self._fill_in_attachments(loaded)
        problems += self._fill_in_cameras(loaded)
        self._filled_entries, self._changed = len(self.log), set()
        # Former inputs stay until here, since other threads may put values into them meanwhile
        self.inputs = {slot: each for slot, each in self.inputs.items() if each is not inputs_before.get(slot)}
        if problems:
            raise ConfigError(problems)

    def moved_cameras(self) -> Iterator[tuple[str, Pose]]:
        """Yields the input slot and the pose of each camera that has been moved from its configured pose."""
        for name, camera in self.cameras.items():
            if camera.pose is not None and camera.pose != self._configured_pose(camera):
                yield f"{name}/pose", camera.pose

    def move_cameras_back(self) -> None:
        """Sets the pose of each camera to the configured pose, or to None if no pose is configured."""
        for camera in self.cameras.values():
            camera.pose = self._configured_pose(camera)

    def rebuild(self, recipe: Recipe, changed: Iterable[str]) -> None:
        """Replaces bodies and cameras by the contents of a recipe, in a fresh client unless PyBullet has a window.

        Args:
            recipe: Recipe of the new contents.
            changed: Names of the bodies that were added or removed after `fill` and before the recipe was made.

        Raises:
            ConfigError: If an object cannot be loaded. Later objects of the recipe are then missing.
            InterfaceError: If PyBullet refuses an object.
        """
        inputs_before, cameras_before = self.inputs, self.cameras
        self.clear()
        if not self._pb.has_window:
            self._pb.become(Client())
        for entry in recipe.entries(self._pb, self._config):
            self._append(entry)
            if entry.what == "add":
                self._take_in(self.bodies[entry.name], entry.arguments[1])
        recipe.check_ids(self.bodies)
        self.cameras = {}
        for config in recipe.cameras:
            camera = cameras_before.get(config.name)
            if camera is not None and camera.config == config:
                self._insert_camera(camera)
            else:
                self.add_camera(config)
        self._changed, self._filled_entries = set(changed), len(self.log)
        self.inputs = {slot: each for slot, each in self.inputs.items() if each is not inputs_before.get(slot)}

    def changed_names(self) -> set[str]:
        """Returns the names of all bodies that were added or removed since `fill`."""
        new = (entry.name for entry in self.log[self._filled_entries :] if entry.what in ("add", "remove"))
        return {*self._changed, *new}

    def _fill_in_attachments(self, loaded: LoadedWorld) -> list[Problem]:
        problems: list[Problem] = []
        for index, config in enumerate(loaded.config.attachments):
            try:
                self.attachments.add(config)
            except (InterfaceError, ValueError) as error:
                problems.append(Problem(loaded.file, f"attachments[{index}]", str(error)))
        return problems

    def _fill_in_cameras(self, loaded: LoadedWorld) -> list[Problem]:
        before, self.cameras = self.cameras, {}
        configs = [item.config for item in loaded.cameras]
        for camera in before.values():
            if any(camera.config is config for config in configs):
                camera.hz = camera.config.hz
                self._insert_camera(camera)
        problems: list[Problem] = []
        for config, file in loaded.cameras:
            if config.name not in self.cameras:
                try:
                    self.add_camera(config, file)
                except ConfigError as error:
                    problems += error.problems
        return problems

    def _insert_camera(self, camera: RgbdSensor) -> None:
        self.cameras = {**self.cameras, camera.name: camera}
        self._register(camera.name, (camera,), camera.inputs())
        if camera.pose is None:
            camera.pose = self._configured_pose(camera)

    def _configured_pose(self, camera: RgbdSensor) -> Pose | None:
        return self._config.pose_of(camera.config.object_tf.tf_id)

    def _take_in(self, body: Body, config: BodyConfig) -> None:
        """Registers sensors and inputs of a new body; adds the body and its pose follower to `stepping` if needed."""
        self._register(body.name, *sensors_and_inputs(body, config))
        if body.pose_follower is not None:
            self.stepping.append(body.pose_follower)
        if type(body).before_step is not Body.before_step and body.needs_steps:
            self.stepping.append(body)

    def _require_new(self, name: str, file: str | None) -> None:
        if name in self.sensors:
            message = f"'{name}' is taken already; names are unique in a world"
            raise ConfigError([Problem(file or name, "name", message)])

    def _append(self, entry: LogEntry) -> None:
        """Applies an entry to the world and appends it to the load log.

        All changes of bodies and physics use this method.
        """
        self.contacts.invalidate()
        apply(self._pb, self.bodies, entry)
        self.log.append(entry)

    def _register(self, name: str, sensors: tuple[Sensor, ...], inputs: Mapping[str, Input]) -> None:
        for sensor in sensors:
            with plugin_errors(sensor, f"enter of '{sensor.name}'"):
                sensor.enter(self._world)
        self.sensors.add(name, sensors)
        self.inputs = {**self.inputs, **{f"{name}/{key}": value for key, value in inputs.items()}}
