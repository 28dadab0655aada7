"""A simulated world: it owns one PyBullet client, the bodies in it and the tick."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import pybullet

from custom_ros_tools.errors import ConfigError, PhysicsError, PluginError, Problem, UnknownNameError

from .actions import ACTIONS
from .bodies import BODY_TYPES, Body, BodyConfig
from .client import Client
from .clock import Clock
from .command_log import CommandLog, WorldCommand
from .config import LoadedWorld, load_world
from .contact_reader import ContactReader
from .dynamics import read_dynamics
from .equipment import equipment
from .inputs import Input
from .link_dynamics import LinkDynamics
from .load_log import LogEntry, apply
from .mailbox import Mailbox
from .plugin_faults import blame, blaming
from .pybullet_models import ChangeDynamics
from .rgbd_config import FIRST_TOPIC_NAME, RgbdSensorConfig
from .sensor_schedule import SensorSchedule
from .sensors import RgbdSensor
from .sensors.sensor import Sensor
from .state_hash import state_hash
from .window import Window, check_recording

log = logging.getLogger(__name__)


class World:
    """A world of bodies and sensors that moves by ticks.

    Only the thread that made the world calls its methods; the exceptions are `put` and the mailbox, through which
    other threads reach it.

    Args:
        loaded: The validated configuration of the world and of all that is in it at the start.
        simulated_time: Whether stamps are simulated time, else wall time.
        connection_mode: PyBullet's connection mode; without it, what the configuration says.

    Raises:
        ConfigError: If a configuration does not fit, for instance names a joint that the robot lacks.
        PhysicsError: If PyBullet does not connect or cannot load something.
    """

    def __init__(
        self, loaded: LoadedWorld, simulated_time: bool = True, connection_mode: int | None = None
    ) -> None:
        self.config = loaded.config
        self.clock = Clock(self.config.timeStep, simulated_time)
        self.mailbox = Mailbox()
        self.bodies: dict[str, Body] = {}
        self.cameras: dict[str, RgbdSensor] = {}
        self.log: list[LogEntry] = []
        self.commands = CommandLog()
        """What entered it since it was built or reset."""
        self.resets = 0
        """How often it was reset."""
        self.loaded = loaded
        """What it was built from, and is again when it is reset."""
        self._is_built = False
        self._built_entries = 0
        """How many entries of the log are of building it."""
        self._inputs: dict[str, Input] = {}
        self._sensors = SensorSchedule(self.clock)
        self._stepping: list[Body] = []
        connect = self.config.connect.kwargs()
        configured_mode = connect.pop("connection_mode")
        mode = configured_mode if connection_mode is None else connection_mode
        if mode != pybullet.DIRECT:
            check_recording(connect.get("options", ""))
        self.pb = Client(mode, **connect)
        self.window = None if mode == pybullet.DIRECT else Window(self.pb)
        self.contacts = ContactReader(self.pb, self.bodies)
        try:
            if mode == pybullet.GUI:
                self._set_up_window()
            self._build()
        except BaseException:
            self.close()
            raise

    @classmethod
    def from_file(cls, path: str, **options: Any) -> World:
        """Builds the world that a main YAML file describes.

        Args:
            path: The file.
            options: Further arguments of the constructor.

        Raises:
            ConfigError: If anything in the file, or in a file that it names, is wrong; it tells all of it at once.
        """
        return cls(load_world(path, BODY_TYPES), **options)

    def add(self, kind: str, config: BodyConfig, file: str | None = None) -> Body:
        """Adds a body; when it raises, the world is as it was.

        Args:
            kind: A key of BODY_TYPES, or `module:Class`.
            config: Configuration of that type.
            file: Where it came from, for messages; without it, they have the body's name.

        Raises:
            ConfigError: If the name is taken or the configuration does not fit.
            PhysicsError: If PyBullet refuses.
            PluginError: If a class of another package fails.
        """
        name = config.name
        self._require_new(name, file)
        try:
            self._append(LogEntry(name, "add", (kind, config)))
            body = self.bodies[name]
            try:
                self._register(name, *equipment(body, config))
            except Exception:
                self._append(LogEntry(name, "remove"))
                raise
        except ConfigError as error:
            raise ConfigError([Problem(file or name, each.key, each.message) for each in error.problems]) from None
        self._note(name, "add", (kind, config))
        if type(body).before_step is not Body.before_step:
            self._stepping.append(body)
        return body

    def add_camera(self, config: RgbdSensorConfig, file: str | None = None) -> RgbdSensor:
        """Adds a camera; when it raises, the world is as it was.

        The first one, and the next to come once that has gone, has the topics `rpbi/camera/...`.

        Args:
            config: What it is.
            file: Where it came from, for messages; without it, they have the camera's name.

        Raises:
            ConfigError: If the name is taken.
        """
        self._require_new(config.name, file)
        taken = {camera.topic_name for camera in self.cameras.values()}
        topic_name = config.name if FIRST_TOPIC_NAME in taken else FIRST_TOPIC_NAME
        if topic_name in taken:
            message = f"'{topic_name}' is what the topics of the first camera are called; use another name"
            raise ConfigError([Problem(file or config.name, "name", message)])
        camera = RgbdSensor(config, self.bodies, self.clock, topic_name)
        self.cameras = {**self.cameras, camera.name: camera}
        self._register(camera.name, (camera,), camera.inputs())
        return camera

    def remove(self, name: str) -> None:
        """Removes a body or a camera.

        Raises:
            UnknownNameError: If there is none of that name.
        """
        if name in self.cameras:
            self.cameras = {other: camera for other, camera in self.cameras.items() if other != name}
        else:
            body = self.bodies.get(name)
            self._append(LogEntry(name, "remove"))
            self._note(name, "remove", None)
            if body in self._stepping:
                self._stepping.remove(body)
        self._sensors.remove(name)
        self._inputs = {slot: taken for slot, taken in self._inputs.items() if slot.split("/")[0] != name}
        self.take_inputs()  # what still waits for it must not meet a later body of the same name

    def dynamics(self, object_name: str) -> LinkDynamics:
        """Returns how an object or a link behaves in contact and motion.

        Args:
            object_name: `NAME`, or `NAME/LINK` for one of its links.

        Raises:
            UnknownNameError: If there is none of that name.
        """
        name, _, link = object_name.partition("/")
        if name not in self.bodies:
            raise UnknownNameError("object", name, list(self.bodies))
        return read_dynamics(self.bodies[name], link)

    def change_dynamics(self, object_name: str, change: ChangeDynamics) -> None:
        """Changes how an object or a link behaves; when it raises, nothing has changed.

        Args:
            object_name: `NAME`, or `NAME/LINK` for one of its links.
            change: What to change.

        Raises:
            UnknownNameError: If there is none of that name.
            ValueError: If it makes no sense for that link.
            PhysicsError: If PyBullet refuses.
        """
        name, _, link = object_name.partition("/")
        self._append(LogEntry(name, "dynamics", (link, change)))
        self._note(object_name, "dynamics", change)

    def act(self, name: str, what: str, value: Any, do: Callable[[Any], Any] | None = None) -> Any:
        """Does something to a body, and notes it as a command; when it raises, nothing is noted.

        Args:
            name: The body.
            what: A key of ACTIONS.
            value: What that takes.
            do: Does the same to the body in another way, for instance with something prepared by another thread.

        Returns:
            What the action returns.

        Raises:
            UnknownNameError: If there is no such body.
            ValueError: If the value is refused.
        """
        body = self.bodies.get(name)
        if body is None:
            raise UnknownNameError("object", name, list(self.bodies))
        result = ACTIONS[what](body, self.clock, value) if do is None else do(body)
        self._note(name, what, value)
        return result

    def put(self, slot: str, value: Any) -> None:
        """Hands a value to a body or sensor before the next tick; any thread may call it.

        Args:
            slot: `NAME/INPUT`, such as `kuka_lwr/target`.
            value: What that input takes.

        Raises:
            UnknownNameError: If there is no such input, or the value names something unknown.
            ValueError: If the value is refused, for instance because it is not finite.
        """
        era = self.mailbox.era
        taken = self._inputs.get(slot)
        if taken is None:
            raise UnknownNameError("input", slot, list(self._inputs))
        self.mailbox.put(slot, taken.check(value), taken.merge, era)

    @property
    def inputs(self) -> dict[str, Input]:
        """What the world takes while it runs, by slot."""
        return self._inputs

    def sensors_of(self, name: str) -> list[Sensor]:
        """Returns the sensors of a body, or the camera of that name."""
        return self._sensors[name]

    @property
    def is_connected(self) -> bool:
        """Whether PyBullet is still there: its window may have been closed, or its server have ended."""
        return bool(self.pb.isConnected())

    def take_inputs(self) -> None:
        """Acts on what came since the last time, unless it was meant for a body that has gone.

        Every step does so first; a world that stands still needs it for the poses that come from TF.
        """
        for slot, value in self.mailbox.take().items():
            if slot in self._inputs:
                self.take_input(slot, value)

    def take_input(self, slot: str, value: Any) -> None:
        """Acts on a value that was checked, and notes it if it is for a body."""
        body = self.bodies.get(slot.split("/")[0])
        with blaming(body or self, f"taking '{slot}' at tick {self.clock.tick}"):
            self._inputs[slot].apply(value)
        if body is not None:
            self._note(slot, "input", value)

    def step(self) -> list[Any]:
        """Goes one tick on.

        Returns:
            The samples that are due at the new tick.

        Raises:
            PhysicsError: If something in the world is not finite any more.
            PluginError: If a class of another package fails.
        """
        self.take_inputs()
        for body in self._stepping:
            try:
                body.before_step(self.clock.tick)
            except Exception as error:
                blame(body, f"before_step of '{body.name}' at tick {self.clock.tick}", error)
                raise
        self._sensors.before_step()
        self.pb.stepSimulation()
        self.contacts.outdate()
        self.clock.advance()
        self._sensors.after_step()
        return self._sensors.read_due()

    def read_rest(self) -> list[Any]:
        """Returns samples of the sensors that were not read at this tick yet."""
        return self._sensors.read_rest()

    def read_idle(self, tick: int, since: int) -> list[Any]:
        """Returns the samples that would have come due between two ticks, had the world not stood still."""
        return self._sensors.read_idle(tick, since)

    def halt(self, reason: str) -> None:
        """Breaks off what bodies were about to do over the coming ticks, such as timed motions."""
        for body in self.bodies.values():
            body.halt(reason)
        self._note("", "halt", reason)

    def pause(self, reason: str) -> None:
        """Breaks off what cannot wait until the world, which is stopped, runs again."""
        for body in self.bodies.values():
            body.pause(reason)
        self._note("", "pause", reason)

    def reset(self) -> None:
        """Makes the world what it was when it was built, to the last bit; stamps go on.

        Objects that came later go, those that were removed come back. Motions end with a reason; inputs that wait are
        dropped. Cameras stay, with the pose that they have. Bodies and their sensors are new objects.

        Raises:
            ConfigError: If something cannot be loaded any more, for instance because its file has gone; then the
                world lacks it.
        """
        self.halt("the world was reset")
        for body in self.bodies.values():
            body.remove()
        self.bodies.clear()
        self.log.clear()
        self._sensors.clear()
        self._stepping.clear()
        self.clock.restart()
        self.resets += 1
        old = self._inputs  # they stay till their like has come, for those who put meanwhile
        self._is_built = False
        try:
            self._build()
        finally:
            self._is_built = True
            self.contacts.outdate()
            self._inputs = {slot: taken for slot, taken in self._inputs.items() if taken is not old.get(slot)}
            self.commands.clear()
            self.mailbox.drop()

    def changed_names(self) -> set[str]:
        """Returns the names of all objects that came or went since the world was built or reset."""
        return {entry.name for entry in self.log[self._built_entries :] if entry.what in ("add", "remove")}

    def state_hash(self) -> str:
        """Returns a text that is the same for worlds in the same state at the same tick, see `state_hash`."""
        return state_hash(self.clock.tick, self.bodies)

    def close(self) -> None:
        """Disconnects from PyBullet and fails the requests that wait."""
        self.mailbox.close()
        try:
            self.halt("the simulation ended")
            self.pb.disconnect()
        except pybullet.error:
            log.debug("PyBullet had disconnected before")

    def _set_up_window(self) -> None:
        for arguments in self.config.configureDebugVisualizer.calls():
            self.pb.configureDebugVisualizer(**arguments)
        self.pb.resetDebugVisualizerCamera(**self.config.resetDebugVisualizerCamera.kwargs())

    def _build(self) -> None:
        self._append(LogEntry("", "world", self.config))
        problems: list[Problem] = []
        for item in self.loaded.objects:
            try:
                self.add(item.type, item.config, item.file)
            except ConfigError as error:
                problems += error.problems
            except (PhysicsError, PluginError) as error:
                problems.append(Problem(item.file, "", str(error)))
        if problems:
            raise ConfigError(problems)
        self._build_cameras()
        self._built_entries = len(self.log)
        self._is_built = True

    def _build_cameras(self) -> None:
        """Adds the cameras; those that have been there since the last time stay, with the pose that they have."""
        before, self.cameras = self.cameras, {}
        configs = [item.config for item in self.loaded.cameras]
        for name, camera in before.items():
            if any(camera.config is config for config in configs):
                self.cameras = {**self.cameras, name: camera}
                self._register(name, (camera,), camera.inputs())
        for config, file in self.loaded.cameras:
            if config.name not in self.cameras:
                self.add_camera(config, file)

    def _require_new(self, name: str, file: str | None) -> None:
        if name in self._sensors:
            message = f"'{name}' is taken already; names are unique in a world"
            raise ConfigError([Problem(file or name, "name", message)])

    def _append(self, entry: LogEntry) -> None:
        """The one way into the world: does what the entry says and logs it."""
        self.contacts.outdate()
        apply(self.pb, self.bodies, entry)
        self.log.append(entry)

    def _note(self, name: str, what: str, value: Any) -> None:
        if self._is_built:
            self.commands.note(WorldCommand(self.clock.tick, name, what, value))

    def _register(self, name: str, sensors: tuple[Sensor, ...], inputs: Any) -> None:
        for sensor in sensors:
            with blaming(sensor, f"enter of '{sensor.name}'"):
                sensor.enter(self)
        self._sensors.add(name, sensors)
        self._inputs = {**self._inputs, **{f"{name}/{key}": value for key, value in inputs.items()}}
