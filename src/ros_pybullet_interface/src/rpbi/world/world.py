"""A simulated world: one PyBullet client with bodies and sensors, advanced tick by tick."""

from __future__ import annotations

import logging
import os
import pkgutil
import time
from collections.abc import Callable, Collection, Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar

import pybullet

from custom_ros_tools.errors import InterfaceError, UnknownNameError, shortened
from rpbi.bodies import Body, BodyConfig
from rpbi.bodies.dynamics import LinkDynamics, read_dynamics
from rpbi.config.pybullet_models import ChangeDynamics
from rpbi.config.pybullet_world_models import PhysicsChange
from rpbi.config.sensors import RgbdSensorConfig
from rpbi.config.world import WORLD_FRAME, AttachmentConfig
from rpbi.engine.client import Client
from rpbi.engine.clock import Clock
from rpbi.engine.inputs import Input
from rpbi.engine.mailbox import Mailbox
from rpbi.plugins import plugin_errors, raise_plugin_error
from rpbi.sensors.rgbd import RgbdSensor
from rpbi.sensors.sensor import Sensor
from rpbi.window import Window, check_recording

from .actions import ACTIONS, MOVES_AT_ONCE
from .contents import WorldContents, state_hash
from .forks.prediction import Candidate, Cost, Prediction, PredictionJob
from .forks.shadow import Fork, Shadow
from .keyframes.keyframe import Keyframe, difference, move, refuse
from .loading import LoadedWorld, load_object, load_world
from .saved.command_log import CommandLog, WorldCommand
from .saved.description import WorldDescription, describe
from .saved.recipe import FreshClient, Recipe
from .saved.state import MAX_TICKS, WorldState
from .saved.values import trusting
from .start_state import StartState

log = logging.getLogger(__name__)

IDLE_ROW_S = 0.0004
"""Intended wall time [s] between two checks for new inputs in `World.run_idle`."""
MAX_IDLE_ROW = 20
"""Maximum number of ticks between two checks for new inputs, since later ticks may take much longer than expected."""

_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")


def _recorded(
    method: Callable[Concatenate[World, _Arguments], _Result],
) -> Callable[Concatenate[World, _Arguments], _Result]:
    """Makes `ChangeWatch` ignore the changes that a method makes in PyBullet.

    The decorated method records these changes itself, as commands.
    """

    @wraps(method)
    def call(world: World, *arguments: _Arguments.args, **options: _Arguments.kwargs) -> _Result:
        changes = world.pb.changes
        changes.recording += 1
        try:
            return method(world, *arguments, **options)
        finally:
            changes.recording -= 1

    return call


class World:
    """A simulated world of bodies and sensors, which advances in ticks.

    Only the thread that made the world may call methods of the world, except `put`, which any thread may call. Other
    threads may also use `mailbox`.

    Args:
        loaded: The validated configuration of the world, its objects and its cameras.
        simulated_time: True: stamps are simulated time. False: stamps are wall time.
        connection_mode: PyBullet's connection mode; by default the mode in the configuration.

    Raises:
        ConfigError: If something cannot be built as configured, for instance a robot lacks a configured joint.
        PhysicsError: If PyBullet does not connect.
    """

    def __init__(self, loaded: LoadedWorld, simulated_time: bool = True, connection_mode: int | None = None) -> None:
        self.config = loaded.config
        self.clock = Clock(self.config.timeStep, simulated_time)
        self.mailbox = Mailbox()
        self.commands = CommandLog()
        """Commands since the world was built or reset."""
        self.resets = 0
        """Number of resets since the world was built."""
        self._shadow: Shadow | None = None
        self._view: Any = None
        self.physics_s = 0.0
        """Total wall time [s] that PyBullet's steps took."""
        self.loaded = loaded
        """Configuration from which the world was built, and is built again at a reset."""
        connect = self.config.connect.kwargs()
        configured_mode = connect.pop("connection_mode")
        mode = configured_mode if connection_mode is None else connection_mode
        if mode != pybullet.DIRECT:
            check_recording(connect.get("options", ""))
        self.pb = Client(mode, **connect)
        self.window = Window(self.pb) if self.pb.has_window else None
        self._contents = WorldContents(self.pb, self.clock, self)
        self.bodies = self._contents.bodies
        self.contacts = self._contents.contacts
        self.attachments = self._contents.attachments
        self._idle_row = 1
        """Number of idle ticks until the next check for new inputs, adapted to the wall time of the last ticks."""
        self._pushed: dict[str, Body] = {}
        """Bodies on which external wrenches act now, or acted in the last tick, indexed by name."""
        self.log = self._contents.log
        self._sensors = self._contents.sensors
        self._stepping = self._contents.stepping
        try:
            if mode == pybullet.GUI:
                self._set_up_window()
            self._contents.fill(loaded)
        except BaseException:
            self.close()
            raise
        self.pb.changes.unrecorded = ""
        self.start_hash = self.state_hash()
        """Hash of the world's state after it was built or last reset."""
        self._description = self._built_from = ""
        self._start: StartState | None = None
        """The state to which `reset(rebuild=False)` returns; None until the first such reset."""
        self._keyframe, self._keyframe_tick = "", 0
        """Text and tick of the last keyframe since the world was built or reset; empty and 0 without a keyframe."""

    @classmethod
    def from_file(cls, path: str, **options: Any) -> World:
        """Builds the world that a main YAML file describes.

        Args:
            path: The main YAML file.
            options: Further arguments of the constructor.

        Raises:
            ConfigError: If the main file, or a file named in it, is not valid; the error lists all problems.
        """
        return cls(load_world(path), **options)

    @classmethod
    def from_description(cls, description: WorldDescription, trust: Collection[str] | None = ()) -> World:
        """Builds the world that a recording describes, without a window.

        Args:
            description: Description of the recorded world.
            trust: Packages from which the recording may import classes, such as types of your own. `rpbi` and packages
                used in this program's configurations are always allowed. None allows all packages.

        Raises:
            ConfigError: If the world cannot be built on this machine, for instance because a file is missing.
        """
        with trusting(trust):
            return cls(description.load(trust), connection_mode=pybullet.DIRECT)

    @classmethod
    def from_state(
        cls, state: WorldState | str | Path, trust: Collection[str] | None = (), max_ticks: int = MAX_TICKS
    ) -> World:
        """Builds the world of a saved state without a window, and simulates it until it reaches the state.

        Args:
            state: The state, or a file that `WorldState.write` wrote.
            trust: Packages from which the state may import classes, see `from_description`.
            max_ticks: Maximum number of ticks to simulate to reach the state.

        Raises:
            ConfigError: If the file cannot be read, or the world cannot be built on this machine.
            InterfaceError: If more than `max_ticks` ticks have to be simulated, or the world does not reach the same
                state, for instance because PyBullet has another version.
        """
        state = state if isinstance(state, WorldState) else WorldState.read(state)
        state.require_short(max_ticks)
        try:
            description = WorldDescription(state.description)
        except ValueError as error:
            raise InterfaceError(str(error)) from None
        world = cls.from_description(description, trust)
        world._built_from = state.description
        try:
            if world.start_hash != description.start_hash:
                reasons = "; ".join(description.warnings) or "the processor or a library may be another"
                raise InterfaceError(f"the world is not the saved one at its start: {reasons}")
            for _ in state.run(world, trust):
                pass
        except BaseException:
            world.close()
            raise
        return world

    @_recorded
    def add(self, kind: str, config: BodyConfig | Mapping[str, Any], file: str | None = None) -> Body:
        """Adds a body. After an error, the world is unchanged.

        Args:
            kind: Type of the body: a key of BODY_TYPES, or `module:Class`.
            config: Configuration of the body, or a mapping of configuration keys to values.
            file: File of the configuration, for messages; the body's name by default.

        Raises:
            ConfigError: If the name is taken or the configuration is not valid.
            PhysicsError: If PyBullet refuses the body.
            PluginError: If a class of another package fails.
        """
        if isinstance(config, Mapping):
            config = load_object(kind, config, file or str(config.get("name", kind)))
        body = self._contents.add(kind, config, file)
        self._note(config.name, "add", (kind, config))
        return body

    def add_camera(self, config: RgbdSensorConfig | Mapping[str, Any], file: str | None = None) -> RgbdSensor:
        """Adds a camera. After an error, the world is unchanged.

        The first camera has the topics `rpbi/camera/...`. After its removal, the next added camera gets these topics.

        Args:
            config: Configuration of the camera, or a mapping of configuration keys to values.
            file: File of the configuration, for messages; the camera's name by default.

        Raises:
            ConfigError: If the name is taken, or the mapping is not a valid configuration.
        """
        if isinstance(config, Mapping):
            config = RgbdSensorConfig.parse(config, file or str(config.get("name", "camera")))
        camera = self._contents.add_camera(config, file)
        self._note(config.name, "add_camera", config)
        return camera

    @_recorded
    def remove(self, name: str) -> None:
        """Removes a body or a camera.

        Raises:
            UnknownNameError: If no body or camera has this name.
        """
        self._contents.remove(name)
        self._pushed.pop(name, None)
        self.clock.bump_stamp()  # another object of that name may be added within this tick, perhaps elsewhere
        self._note(name, "remove", None)
        self.apply_inputs()  # waiting inputs must not reach a later body of the same name

    def dynamics(self, object_name: str) -> LinkDynamics:
        """Returns the dynamics of a link, such as mass and friction.

        Args:
            object_name: `NAME` for the root link of a body, or `NAME/LINK`.

        Raises:
            UnknownNameError: If there is no such body or link.
        """
        name, _, link = object_name.partition("/")
        return read_dynamics(self._contents.body(name), link)

    @_recorded
    def change_dynamics(self, object_name: str, change: ChangeDynamics | Mapping[str, Any]) -> None:
        """Changes the dynamics of a link. After an error, the world is unchanged.

        Args:
            object_name: `NAME` for the root link of a body, or `NAME/LINK`.
            change: New values of dynamics, or a mapping of `ChangeDynamics` keys to values.

        Raises:
            ConfigError: If the mapping is not valid.
            UnknownNameError: If there is no such body or link.
            ValueError: If the link cannot have the new values.
            PhysicsError: If PyBullet refuses the change.
        """
        if isinstance(change, Mapping):
            change = ChangeDynamics.parse(change, object_name)
        name, _, link = object_name.partition("/")
        self._contents.change_dynamics(name, link, change)
        self._note(object_name, "dynamics", change)

    @_recorded
    def attach(self, config: AttachmentConfig | Mapping[str, Any]) -> None:
        """Attaches a body to another body. After an error, the world is unchanged.

        Args:
            config: Configuration of the attachment, or a mapping of configuration keys to values.

        Raises:
            ConfigError: If the mapping is not a valid configuration.
            UnknownNameError: If there is no such body or link.
            ValueError: If the attachment's name is taken, or the bodies cannot be attached to each other.
            PhysicsError: If PyBullet refuses the attachment.
        """
        if isinstance(config, Mapping):
            config = AttachmentConfig.parse(config, "attachment")
        self.attachments.add(config)
        self._note(config.name, "attach", config)

    @_recorded
    def detach(self, name: str) -> None:
        """Removes an attachment.

        Raises:
            UnknownNameError: If no attachment has this name.
        """
        self.attachments.remove(name)
        self._note(name, "detach", None)

    @_recorded
    def change_physics(self, change: PhysicsChange) -> None:
        """Changes gravity, or parameters of PyBullet's engine, until the next reset."""
        self._contents.change_physics(change)
        self._note("", "physics", change)

    def set_sensor_rate(self, name: str, number: int, hz: float) -> None:
        """Changes the rate of a sensor from the present tick until the next reset.

        Args:
            name: Name of the sensor's body, or of the camera.
            number: Index of the sensor in `sensors_of(name)`.
            hz: New rate [Hz] in simulated time; 0 switches the sensor off.

        Raises:
            UnknownNameError: If no body or camera has this name.
            ValueError: If there is no such sensor, or the rate is negative or not finite.
        """
        if name not in self._sensors:
            raise UnknownNameError("object", name, [*self.bodies, *self.cameras])
        self._sensors.set_rate(name, number, hz)
        self._note(name, "sensor_rate", (number, hz))

    @_recorded
    def act(self, name: str, what: str, value: Any, do: Callable[[Any], Any] | None = None) -> Any:
        """Applies an action to a body, and records the action as a command. After an error, nothing is recorded.

        Args:
            name: Name of the body.
            what: Name of the action, a key of ACTIONS.
            value: Value for the action. Instead of a named tuple, a mapping of field names to values is accepted.
            do: Function that is called with the body, instead of the action's own function. It must have the same
                effect, but may for instance use data prepared in another thread.

        Returns:
            Result of the action.

        Raises:
            UnknownNameError: If there is no such body or action.
            ValueError: If the value is refused.
        """
        body = self._contents.body(name)
        if what not in ACTIONS:
            raise UnknownNameError("action", what, list(ACTIONS))
        action = ACTIONS[what]
        value = action.value(value)
        if what in MOVES_AT_ONCE:
            self.attachments.refuse_moving(name)
        result = action.do(body, self.clock, value) if do is None else do(body)
        self._note_pushed(body)
        self._note(name, what, value)
        return result

    def put(self, slot: str, value: Any) -> None:
        """Sends a value to an input of a body or sensor. The value takes effect before the next tick.

        Any thread may call this method.

        Args:
            slot: The input, as `NAME/INPUT`, such as `kuka_lwr/target`.
            value: Value for the input. Instead of a joint target, a mapping of joint names to numbers is accepted.
                Instead of any other named tuple, a mapping of field names to values is accepted.

        Raises:
            UnknownNameError: If there is no such input, or the value contains an unknown name.
            ValueError: If the value is refused, for instance because it is not finite.
        """
        generation = self.mailbox.generation
        inputs = self.inputs
        if slot not in inputs:
            raise UnknownNameError("input", slot, list(inputs))
        receiver = inputs[slot]
        self.mailbox.put(slot, receiver.check(value), receiver.merge, generation)

    @property
    def inputs(self) -> dict[str, Input]:
        """Inputs of all bodies and sensors, indexed by slot (`NAME/INPUT`)."""
        return self._contents.inputs

    @property
    def cameras(self) -> dict[str, RgbdSensor]:
        """Cameras, indexed by name; adding or removing a camera creates a new dictionary."""
        return self._contents.cameras

    def sensors_of(self, name: str) -> list[Sensor]:
        """Returns the sensors of a body; for the name of a camera, returns a list with the camera."""
        return self._sensors[name]

    def frames(self) -> set[str]:
        """Returns the names of the TF frames that the world publishes, without the configured `tf_prefix`.

        These are the world frame, the frames configured under `poses`, and the frames of the bodies' sensors.
        """
        poses = (pose.tf_id for pose in self.config.poses)
        sensors = (sensor for name in self.bodies for sensor in self.sensors_of(name))
        return {WORLD_FRAME, *poses, *(frame for sensor in sensors for frame in sensor.tf_frames)}

    @property
    def is_connected(self) -> bool:
        """Whether PyBullet is still connected. Closing PyBullet's window or ending its server ends the connection."""
        return bool(self.pb.isConnected())

    def apply_inputs(self) -> None:
        """Applies the inputs that arrived since the last call; inputs of removed bodies and cameras are ignored.

        Every step calls this method first. While the world is stopped, the simulation loop also calls this method, so
        that bodies still follow poses from TF.
        """
        for slot, value in self.mailbox.drain().items():
            if slot in self.inputs:
                self.apply_input(slot, value)

    @_recorded
    def apply_input(self, slot: str, value: Any) -> None:
        """Applies a value, which was already checked, to an input, and records the value as a command."""
        body = self.bodies.get(slot.split("/")[0])
        with plugin_errors(body or self, f"applying '{slot}' at tick {self.clock.tick}"):
            self.inputs[slot].apply(value)
        if body is not None:
            self._note_pushed(body)
        self._note(slot, "input", value)

    def step(self) -> list[Any]:
        """Applies waiting inputs, and advances the world by a tick.

        Returns:
            Samples of the sensors that are due at the new tick.

        Raises:
            PhysicsError: If a number in the state of the world is no longer finite.
            PluginError: If a class of another package fails.
        """
        changes = self.pb.changes
        changes.recording += 1
        try:
            samples = self._step()
        finally:
            changes.recording -= 1
        if self._view is not None:
            self._view.update()
        return samples

    def _step(self) -> list[Any]:
        self.apply_inputs()
        for body in self._stepping:
            try:
                body.before_step(self.clock.tick)
            except Exception as error:
                raise_plugin_error(body, f"before_step of '{body.name}' at tick {self.clock.tick}", error)
                raise
        if self._pushed:
            self._push()
        watching = self._sensors.watching
        if watching:
            self._sensors.act("before_step")
        begin_s = time.perf_counter()
        self.pb.advance()
        self.physics_s += time.perf_counter() - begin_s
        self.contacts.invalidate()
        self.clock.advance()
        if watching:
            self._sensors.act("after_step")
        if self.attachments.limited:
            self.attachments.break_overloaded(self.clock.tick)
        return self._sensors.read_due()

    def run_idle(self, ticks: float, end_s: float) -> int:
        """Advances the world by ticks in which only PyBullet's physics acts.

        The result is the same as with `step`, but takes less time. Stops before a tick at which a body, an external
        wrench, an attachment with a force limit or a sensor has to be updated. Stops within MAX_IDLE_ROW ticks after
        a new input has arrived.

        Args:
            ticks: Maximum number of ticks.
            end_s: Time [s] of `time.monotonic` at which to stop.

        Returns:
            Number of ticks by which the world has advanced.
        """
        if self._pushed or self.attachments.limited:
            return 0
        for body in self._stepping:
            if not body.is_idle:
                return 0
        mailbox, step, now = self.mailbox, self.pb.advance, time.monotonic
        done, last = 0, min(ticks, self._sensors.idle_ticks)
        begin_s = now_s = now()
        while done < last and now_s < end_s and mailbox.is_empty:
            row = int(min(self._idle_row, last - done))
            for _ in range(row):
                step()
            done += row
            before_s, now_s = now_s, now()
            self._idle_row = max(1, int(min(MAX_IDLE_ROW, row * IDLE_ROW_S / max(now_s - before_s, 1e-9))))
        self.physics_s += now_s - begin_s
        if done:
            self.clock.skip(done)
            self.contacts.invalidate()
        return done

    def read_rest(self) -> list[Any]:
        """Reads the sensors that have not been read at the present tick, and returns their samples.

        Sensors with rate 0 or without a receiver of their samples are not read.
        """
        return self._sensors.read_rest()

    def read_idle(self, tick: int, since: int) -> list[Any]:
        """Reads the sensors that would be due if the stopped world were running, and returns their samples.

        Args:
            tick: Tick that a running world would have reached by now.
            since: Tick that a running world would have reached at the last call of this method. Sensors are read if
                they are due at a tick after `since` and up to `tick`.
        """
        return self._sensors.read_idle(tick, since)

    @_recorded
    def halt(self, reason: str) -> None:
        """Aborts all running actions of the world's bodies, such as timed motions.

        Args:
            reason: Reason that the aborted actions report.
        """
        for body in self.bodies.values():
            body.halt(reason)
        self._note("", "halt", reason)

    @_recorded
    def pause(self, reason: str) -> None:
        """Aborts those running actions of bodies that could not be continued after a stop of the simulation.

        Args:
            reason: Reason that the aborted actions report.
        """
        for body in self.bodies.values():
            body.pause(reason)
        self._note("", "pause", reason)

    def reset(self, rebuild: bool = True) -> None:
        """Resets the world to exactly the state in which it was built. Stamps continue to increase.

        Objects that were added are removed, and objects that were removed are added again. Running motions are aborted
        and waiting inputs are dropped. Cameras keep their poses. Gravity, engine parameters and sensor rates are set
        to their configured values.

        Args:
            rebuild: True: all bodies are loaded again, as new Python objects. False: bodies are kept if their states
                can be restored exactly, which takes less than a millisecond; otherwise bodies are loaded again. Exact
                restoring is possible, for instance, if robots without controllers have only followed targets, and
                bodies were only moved or changed in their dynamics; see `StartState`.

        Raises:
            ConfigError: If an object cannot be loaded again, for instance because its file is missing. The world is
                then reset without this object.
        """
        self._end_shadow()
        if not rebuild and self._rewind():
            return
        if self._start is not None:
            self._start.close()
            self._start = None
        self._keyframe, self._keyframe_tick = "", 0
        self.halt("the world was reset")
        self._contents.clear()
        self._pushed.clear()
        self.clock.restart()
        self.resets += 1
        try:
            self._contents.fill(self.loaded)
        finally:
            self._forget_commands()
            self.start_hash, self._description = self.state_hash(), ""
        if not rebuild and StartState.suits(self._contents):
            self._start = StartState(self.pb, self._contents)

    def _rewind(self) -> bool:
        """Tries to restore the start state without loading bodies; returns whether the state was restored exactly."""
        if self._start is None or self.pb.changes.unrecorded or not self._start.restore(self.commands):
            return False
        self.clock.restart()
        self.contacts.invalidate()
        self._sensors.restart()
        self.resets += 1
        self._forget_commands()
        return self.state_hash() == self.start_hash

    def _forget_commands(self) -> None:
        """Clears commands and waiting inputs, and records the changed poses of cameras as first commands."""
        self.commands.clear()
        self.pb.changes.unrecorded = ""
        self.mailbox.drop()
        for slot, pose in self._contents.moved_cameras():
            self._note(slot, "input", pose)

    def describe(self) -> str:
        """Returns a JSON text from which the same world can be built, see `WorldDescription`."""
        if not self._description:
            self._description = describe(self.loaded, self.start_hash)
        return self._description

    def view(self, host: str = "127.0.0.1", port: int = 0) -> Any:
        """Shows the world in browsers while it is stepped, see docs/browser.md; needs the extra `html`.

        Args:
            host: Address to listen at. On another address than a loopback one, the link has a token.
            port: Port of the page; 0 chooses a free port.

        Returns:
            A `rpbi_data.view.script_view.WorldView`, which has the address of the page as `link`, and the methods
            `update` and `close`. A notebook shows the page.

        Raises:
            InterfaceError: If the port is in use, or the extra is missing.
        """
        if self._view is not None:
            self._view.close()
        view = pkgutil.resolve_name("rpbi_data.view.script_view:WorldView")  # of a package above this one
        self._view = view(self, host, port)
        return self._view

    def keyframe(self, recorded: str = "") -> None:
        """Makes a keyframe: moves the world into a fresh PyBullet client, and drops the earlier commands.

        From then on, the simulation depends on the present state alone. `save`, `restore`, `fork` and `predict` start
        from the keyframe. Bodies and sensors stay the same Python objects.

        Args:
            recorded: Text of a recorded keyframe of this world at this tick, with which the new keyframe is compared.

        Raises:
            InterfaceError: If the world has a window, a soft body, a body of another package, an object with a state
                that cannot be written, or a change that was not recorded. The world is then unchanged. Also if the new
                keyframe, which is then in effect, differs from the recorded keyframe.
            ConfigError: If a body cannot be loaded again, for instance because its file is missing. The world is then
                unchanged.
        """
        for _ in self.keyframe_in_parts():
            pass
        if recorded and (part := difference(self._keyframe, recorded)):
            raise InterfaceError(f"the keyframe at tick {self.clock.tick} is not the recorded one: '{part}' differs")

    def keyframe_in_parts(self) -> Iterator[None]:
        """Makes a keyframe as `keyframe` does, but in parts, and yields after each part.

        Each part builds one body in the fresh client. The world may step between parts. If bodies are added, removed or
        changed between parts, all bodies are built again. The world moves into the fresh client in the last part.
        """
        while True:
            refuse(self)
            self._require_recorded()
            recipe = Recipe.of(self._contents)
            entries = len(self.log)
            fresh = FreshClient(recipe, self.loaded.config)
            try:
                for _ in fresh.build():
                    yield
                    if len(self.log) != entries:
                        break
                self.apply_inputs()
                if len(self.log) == entries and Recipe.of(self._contents) == recipe:
                    self._move(fresh)
                    return
            except BaseException:
                fresh.close()
                raise
            fresh.close()

    @_recorded
    def _move(self, fresh: FreshClient) -> None:
        self._keyframe = move(self, self._contents, self._pushed, fresh)
        self._keyframe_tick = self.clock.tick
        self._start = None  # it was in the former client
        self._note("", "keyframe", self._keyframe)
        self.commands.forget()

    @_recorded
    def enter_keyframe(self, keyframe: str, trust: Collection[str] | None = ()) -> None:
        """Sets the world, which was just built or reset, to the state in a keyframe.

        Args:
            keyframe: Text of the keyframe.
            trust: Packages from which the keyframe may import classes, see `from_description`.

        Raises:
            InterfaceError: If the text is not a keyframe of this world, or an object cannot be loaded on this machine.
        """
        try:
            with trusting(trust):
                read = Keyframe(keyframe)
                self._contents.rebuild(read.recipe, read.changed)
                self._pushed = read.enter(self, self._contents)
            self.clock.skip(read.tick - self.clock.tick)
            self._contents.sensors.reschedule()
        except InterfaceError:
            raise
        except Exception as error:  # the text may hold anything
            raise InterfaceError(f"the keyframe makes no sense in this world: {shortened(str(error))}") from error
        self._keyframe, self._keyframe_tick = keyframe, read.tick

    def save(self, file: str | Path | None = None, *, keyframe: bool = False) -> WorldState:
        """Applies waiting inputs, and returns the present state, from which the simulation continues bit-identically.

        The state consists of all commands since the world was built or reset, or since its last keyframe. Restoring the
        state simulates all ticks since then again.

        Args:
            file: File to which the state is also written; by default no file is written.
            keyframe: Whether to make a keyframe first, see `keyframe`. The state then contains no commands.

        Raises:
            InterfaceError: If the world has soft bodies, whose motion is not reproducible, a command that cannot be
                recorded, or a change of PyBullet that was not recorded.
            OSError: If the file cannot be written.
        """
        if keyframe:
            self.keyframe()
        if soft := [body.name for body in self.bodies.values() if body.is_soft]:
            raise InterfaceError(f"expected no soft bodies, which never move the same way twice, got {', '.join(soft)}")
        self._require_recorded()
        self.apply_inputs()
        commands = tuple(self.commands.records())
        begin = self._keyframe, self._keyframe_tick
        state = WorldState(self.describe(), commands, self.clock.tick, self.state_hash(), *begin)
        if file is not None:
            state.write(file)
        return state

    def restore(self, state: WorldState, trust: Collection[str] | None = (), max_ticks: int = MAX_TICKS) -> None:
        """Restores a saved state of this world. Stamps continue to increase.

        Args:
            state: State from `save`.
            trust: Packages from which the commands may import classes, see `from_description`.
            max_ticks: Maximum number of ticks to simulate to reach the state.

        Raises:
            InterfaceError: If the state is from another world, or more than `max_ticks` ticks have to be simulated.
                Also if the world does not reach the same state again; the world is then reset.
        """
        self.require_own(state)
        state.require_short(max_ticks)
        for _ in self.restoring(state, trust):
            pass

    def restoring(self, state: WorldState, trust: Collection[str] | None = ()) -> Generator[int, None, None]:
        """Restores a state as `restore` does, but without checking the state first; yields each simulated tick.

        If the generator is closed before its end, the world is reset.
        """
        self._contents.move_cameras_back()
        self.reset()
        try:
            yield from state.run(self, trust)
        except BaseException:
            self.reset()
            raise

    def require_own(self, state: WorldState) -> None:
        """Checks that a state was saved by this world, or by an equal world built from the same files.

        Raises:
            InterfaceError: If the state is from another world, or a file of the world has changed since.
        """
        if state.description not in (self.describe(), self._built_from):
            raise InterfaceError(
                "the state is of another world, or one of its files has changed: build that world by World.from_state"
            )

    def _require_recorded(self) -> None:
        """Checks that all changes of PyBullet were recorded as commands.

        Raises:
            InterfaceError: If a change was not recorded.
        """
        if name := self.pb.changes.unrecorded:
            raise InterfaceError(
                f"something not recorded acts: PyBullet's {name} was called since the last reset, by other means than "
                "the methods of World, such as put, act and change_dynamics"
            )

    def prepare_forks(self) -> None:
        """Starts the process that `fork` and `predict` use, so that their first call takes less time.

        Raises:
            InterfaceError: If the state cannot be saved.
        """
        self.apply_inputs()
        if self._shadow is not None and self._shadow.commands < self.commands.first:  # there was a keyframe
            if self._shadow.is_copy:
                self._end_shadow()
            else:
                self._shadow.restore(self.save(), self.commands.count)
        if self._shadow is None:
            self._shadow = Shadow.of(self, self.save())

    def fork(self, count: int = 1) -> list[Fork]:
        """Copies the world into new processes, and returns the copies, which continue bit-identically.

        The copies are forks of a shadow: a process that repeats this world's commands. If this process has a single
        thread, little memory and no window, the shadow is a fork of this process. Otherwise the shadow is a new
        process, and the first call takes as long as simulating again from the last reset or keyframe.

        Args:
            count: Number of copies.

        Raises:
            InterfaceError: If the state cannot be saved, or the shadow does not reach the same state.
        """
        with self._followed() as shadow:
            return shadow.fork(count)

    def predict(
        self,
        candidates: Sequence[Candidate],
        ticks: int,
        *,
        watch: Sequence[str] | None = None,
        every: int = 10,
        cost: Cost | str | None = None,
        jobs: int | None = None,
    ) -> list[Prediction]:
        """Simulates each of several input sequences from the present state in other processes; returns the results.

        Args:
            candidates: The input sequences. Running motions continue in all simulations.
            ticks: Number of ticks to simulate.
            watch: Names of the bodies whose motion is sampled; all bodies by default.
            every: Number of ticks between two samples of the motion.
            cost: Cost of the world's state, summed over all ticks. A module-level function from `World` to a number,
                a class whose objects are such functions, or `module:name` of such a function or class.
            jobs: Maximum number of processes at a time; by default the number of processors.

        Returns:
            A prediction for each candidate, in the order of the candidates.

        Raises:
            InterfaceError: If the state cannot be saved, or the shadow (see `fork`) does not reach the same state.
            UnknownNameError: If a watched body is unknown.
            ValueError: If `ticks`, `every` or `jobs` is not positive.
        """
        if min(ticks, every, 1 if jobs is None else jobs) < 1:
            raise ValueError(f"ticks, every and jobs: expected at least 1, got {ticks}, {every} and {jobs}")
        names = tuple(self.bodies if watch is None else watch)
        for name in names:
            self._contents.body(name)
        job = PredictionJob(ticks, names, every, cost)
        with self._followed() as shadow:
            return shadow.predict(candidates, job, jobs or os.cpu_count() or 1)

    @contextmanager
    def _followed(self) -> Iterator[Shadow]:
        """Yields the shadow of this world after the shadow has reached the present state; an error ends the shadow."""
        self._require_recorded()
        try:
            self.prepare_forks()
            assert self._shadow is not None
            new = self.commands.records(self._shadow.commands)
            self._shadow.follow(new, self.clock.tick, self.state_hash())
            yield self._shadow
        except BaseException:  # after an interruption, the next request would get this answer
            self._end_shadow()
            raise

    def _end_shadow(self) -> None:
        if self._shadow is not None:
            self._shadow.close()
            self._shadow = None

    def changed_names(self) -> set[str]:
        """Returns the names of all bodies that were added or removed since the world was built or reset."""
        return self._contents.changed_names()

    def state_hash(self) -> str:
        """Returns a hash of the present tick and state, see `contents.state_hash`; equal worlds have equal hashes."""
        return state_hash(self.clock.tick, self.bodies)

    def close(self) -> None:
        """Ends waiting requests with an error, ends the view and the shadow, disconnects from PyBullet, and closes all
        bodies.
        """
        self.mailbox.close()
        if self._view is not None:
            self._view.close()
        self._end_shadow()
        try:
            self.halt("the simulation ended")
            self.pb.disconnect()
        except pybullet.error:
            log.debug("PyBullet had disconnected before")
        finally:
            for body in self.bodies.values():
                body.close()

    def _set_up_window(self) -> None:
        for arguments in self.config.configureDebugVisualizer.calls():
            self.pb.configureDebugVisualizer(**arguments)
        self.pb.resetDebugVisualizerCamera(**self.config.resetDebugVisualizerCamera.kwargs())

    def _note_pushed(self, body: Body) -> None:
        if "external_wrenches" in vars(body) and body.external_wrenches.acts:
            self._pushed[body.name] = body

    def _push(self) -> None:
        for name, body in list(self._pushed.items()):
            body.external_wrenches.apply(body.link_pose)
            if not body.external_wrenches.loads:
                del self._pushed[name]

    def _note(self, name: str, what: str, value: Any) -> None:
        self.commands.note(WorldCommand(self.clock.tick, name, what, value))
