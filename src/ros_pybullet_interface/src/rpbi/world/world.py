"""A simulated world: it owns one PyBullet client, the bodies in it and the tick."""

from __future__ import annotations

import logging
import os
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
"""Wall time that idle ticks in a row are to take [s] before the world looks for inputs again."""
MAX_IDLE_ROW = 20
"""Largest number of idle ticks in a row, since the next ones may take much longer than the last."""

_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")


def _recorded(
    method: Callable[Concatenate[World, _Arguments], _Result],
) -> Callable[Concatenate[World, _Arguments], _Result]:
    """Marks a method whose changes of PyBullet are repeated by recorded commands; see `ChangeWatch`."""

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
    """A world of bodies and sensors that moves by ticks.

    Only the thread that made the world calls its methods; the exceptions are `put` and the mailbox, through which
    other threads reach it.

    Args:
        loaded: The validated configuration of the world and of its contents at the start.
        simulated_time: Whether stamps are simulated time, else wall time.
        connection_mode: PyBullet's connection mode; by default that of the configuration.

    Raises:
        ConfigError: If a configuration does not fit, for instance names a joint that the robot lacks.
        PhysicsError: If PyBullet does not connect or cannot load something.
    """

    def __init__(self, loaded: LoadedWorld, simulated_time: bool = True, connection_mode: int | None = None) -> None:
        self.config = loaded.config
        self.clock = Clock(self.config.timeStep, simulated_time)
        self.mailbox = Mailbox()
        self.commands = CommandLog()
        """Commands since it was built or reset."""
        self.resets = 0
        """Number of resets."""
        self._shadow: Shadow | None = None
        self.physics_s = 0.0
        """Wall time that PyBullet's steps took [s]."""
        self.loaded = loaded
        """Configuration that it was built from, and is again at a reset."""
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
        """Number of idle ticks in a row, by the time that the last ones took."""
        self._pushed: dict[str, Body] = {}
        """Bodies that external wrenches act on, or acted on in the last tick."""
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
        """Hash of the state when it was built, or was reset the last time."""
        self._description = self._built_from = ""
        self._start: StartState | None = None
        """Its start, since the first reset without rebuilding."""
        self._keyframe, self._keyframe_tick = "", 0
        """Its last keyframe since it was built or reset, and its tick."""

    @classmethod
    def from_file(cls, path: str, **options: Any) -> World:
        """Builds the world that a main YAML file describes; the options are further arguments of the constructor.

        Raises:
            ConfigError: If anything in the file, or in a file that it names, is wrong; it lists all problems.
        """
        return cls(load_world(path), **options)

    @classmethod
    def from_description(cls, description: WorldDescription, trust: Collection[str] | None = ()) -> World:
        """Builds the world that a recording describes, without a window.

        Args:
            description: The description.
            trust: Packages that it may import, besides `rpbi` and those that this program's configurations have used,
                for types of the user's own. None: any package, for a recording that this program made.

        Raises:
            ConfigError: If it cannot be built here, for instance because a file is missing.
        """
        with trusting(trust):
            return cls(description.load(trust), connection_mode=pybullet.DIRECT)

    @classmethod
    def from_state(
        cls, state: WorldState | str | Path, trust: Collection[str] | None = (), max_ticks: int = MAX_TICKS
    ) -> World:
        """Builds a world, without a window, and restores a saved state in it.

        Args:
            state: The state, or a file that `WorldState.write` wrote.
            trust: Packages that it may import, see `from_description`.
            max_ticks: Age of a state beyond which it is refused.

        Raises:
            ConfigError: If the file cannot be read, or the world cannot be built here.
            InterfaceError: If the state is too old, or the world does not reach the same state here, for instance
                with another PyBullet.
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
        """Adds a body; when it raises, the world is as it was.

        Args:
            kind: A key of BODY_TYPES, or `module:Class`.
            config: Configuration of that type, or a mapping of its keys.
            file: Where it came from, for messages; without it, they have the body's name.

        Raises:
            ConfigError: If the name is taken or the configuration does not fit.
            PhysicsError: If PyBullet refuses.
            PluginError: If a class of another package fails.
        """
        if isinstance(config, Mapping):
            config = load_object(kind, config, file or str(config.get("name", kind)))
        body = self._contents.add(kind, config, file)
        self._note(config.name, "add", (kind, config))
        return body

    def add_camera(self, config: RgbdSensorConfig | Mapping[str, Any], file: str | None = None) -> RgbdSensor:
        """Adds a camera; when it raises, the world is as it was.

        The first one, and the next to come once that has gone, has the topics `rpbi/camera/...`.

        Args:
            config: Its configuration, or a mapping of its keys.
            file: Its file, for messages; without it, they have the camera's name.

        Raises:
            ConfigError: If the name exists already, or the mapping does not fit.
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
            UnknownNameError: If there is none of that name.
        """
        self._contents.remove(name)
        self._pushed.pop(name, None)
        self.clock.bump_stamp()  # another object of that name may be added within this tick, perhaps elsewhere
        self._note(name, "remove", None)
        self.apply_inputs()  # waiting inputs must not reach a later body of the same name

    def dynamics(self, object_name: str) -> LinkDynamics:
        """Returns the dynamics of an object or a link.

        Args:
            object_name: `NAME`, or `NAME/LINK` for one of its links.

        Raises:
            UnknownNameError: If there is none of that name.
        """
        name, _, link = object_name.partition("/")
        return read_dynamics(self._contents.body(name), link)

    @_recorded
    def change_dynamics(self, object_name: str, change: ChangeDynamics | Mapping[str, Any]) -> None:
        """Changes the dynamics of an object or a link; when it raises, nothing has changed.

        Args:
            object_name: `NAME`, or `NAME/LINK` for one of its links.
            change: The change, or a mapping of its keys.

        Raises:
            ConfigError: If the mapping does not fit.
            UnknownNameError: If there is none of that name.
            ValueError: If it is invalid for that link.
            PhysicsError: If PyBullet refuses.
        """
        if isinstance(change, Mapping):
            change = ChangeDynamics.parse(change, object_name)
        name, _, link = object_name.partition("/")
        self._contents.change_dynamics(name, link, change)
        self._note(object_name, "dynamics", change)

    @_recorded
    def attach(self, config: AttachmentConfig | Mapping[str, Any]) -> None:
        """Attaches a body to another; when it raises, nothing has changed.

        Args:
            config: The attachment, or a mapping of its keys.

        Raises:
            ConfigError: If the mapping does not fit.
            UnknownNameError: If there is no such body or link.
            ValueError: If its name is taken, or the two cannot be attached.
            PhysicsError: If PyBullet refuses.
        """
        if isinstance(config, Mapping):
            config = AttachmentConfig.parse(config, "attachment")
        self.attachments.add(config)
        self._note(config.name, "attach", config)

    @_recorded
    def detach(self, name: str) -> None:
        """Ends an attachment.

        Raises:
            UnknownNameError: If there is none of that name.
        """
        self.attachments.remove(name)
        self._note(name, "detach", None)

    @_recorded
    def change_physics(self, change: PhysicsChange) -> None:
        """Changes gravity, or the solver of contacts and joints; a reset undoes it."""
        self._contents.change_physics(change)
        self._note("", "physics", change)

    def set_sensor_rate(self, name: str, number: int, hz: float) -> None:
        """Changes the rate of a sensor; a reset undoes it.

        Args:
            name: The body that has it, or the camera.
            number: Its index in `sensors_of(name)`.
            hz: Its rate [Hz] of the world's time from this tick on; 0 is off.

        Raises:
            UnknownNameError: If there is no body or camera of that name.
            ValueError: If there is no such sensor, or the rate is negative or not finite.
        """
        if name not in self._sensors:
            raise UnknownNameError("object", name, [*self.bodies, *self.cameras])
        self._sensors.set_rate(name, number, hz)
        self._note(name, "sensor_rate", (number, hz))

    @_recorded
    def act(self, name: str, what: str, value: Any, do: Callable[[Any], Any] | None = None) -> Any:
        """Applies an action to a body, and logs it as a command; when it raises, nothing is logged.

        Args:
            name: The body.
            what: A key of ACTIONS.
            value: Its value; for a named tuple also a mapping of its fields.
            do: Does the same to the body in another way, for instance with something prepared by another thread.

        Returns:
            What the action returns.

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
        """Passes a value to a body or sensor before the next tick; any thread may call it.

        Args:
            slot: `NAME/INPUT`, such as `kuka_lwr/target`.
            value: Value of that input. For a target of joints also a mapping of them to numbers, for a named tuple one
                of its fields.

        Raises:
            UnknownNameError: If there is no such input, or the value names something unknown.
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
        """Inputs of the world by slot."""
        return self._contents.inputs

    @property
    def cameras(self) -> dict[str, RgbdSensor]:
        """The cameras by name; a new dictionary with every change."""
        return self._contents.cameras

    def sensors_of(self, name: str) -> list[Sensor]:
        """Returns the sensors of a body, or the camera of that name."""
        return self._sensors[name]

    def frames(self) -> set[str]:
        """Returns the TF frames that it publishes, without prefix: its own, of sensors, and under `poses`."""
        poses = (pose.tf_id for pose in self.config.poses)
        sensors = (sensor for name in self.bodies for sensor in self.sensors_of(name))
        return {WORLD_FRAME, *poses, *(frame for sensor in sensors for frame in sensor.tf_frames)}

    @property
    def is_connected(self) -> bool:
        """Whether PyBullet is still connected: its window may have been closed, or its server may have ended."""
        return bool(self.pb.isConnected())

    def apply_inputs(self) -> None:
        """Applies the inputs that came since the last call, except those for bodies that were removed meanwhile.

        Every step begins with it; a stopped world needs it for poses from TF.
        """
        for slot, value in self.mailbox.drain().items():
            if slot in self.inputs:
                self.apply_input(slot, value)

    @_recorded
    def apply_input(self, slot: str, value: Any) -> None:
        """Applies a checked value, and logs it as a command."""
        body = self.bodies.get(slot.split("/")[0])
        with plugin_errors(body or self, f"applying '{slot}' at tick {self.clock.tick}"):
            self.inputs[slot].apply(value)
        if body is not None:
            self._note_pushed(body)
        self._note(slot, "input", value)

    def step(self) -> list[Any]:
        """Advances by a tick.

        Returns:
            The samples that are due at the new tick.

        Raises:
            PhysicsError: If something in the world is not finite any more.
            PluginError: If a class of another package fails.
        """
        changes = self.pb.changes
        changes.recording += 1
        try:
            return self._step()
        finally:
            changes.recording -= 1

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
        """Advances by ticks at which physics alone acts: no input, body, wrench, attachment or sensor.

        It does the same as that many calls of `step`, in less time. A new input acts after a few ticks.

        Args:
            ticks: Largest number of ticks.
            end_s: Time by the monotonic clock at which it returns [s].

        Returns:
            The number of ticks.
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
        """Returns samples of the sensors that were not read at this tick yet."""
        return self._sensors.read_rest()

    def read_idle(self, tick: int, since: int) -> list[Any]:
        """Returns the samples that would have been due between two ticks if the world had not been stopped."""
        return self._sensors.read_idle(tick, since)

    @_recorded
    def halt(self, reason: str) -> None:
        """Aborts what bodies do over several ticks, such as timed motions."""
        for body in self.bodies.values():
            body.halt(reason)
        self._note("", "halt", reason)

    @_recorded
    def pause(self, reason: str) -> None:
        """Aborts what cannot wait until the stopped world runs again."""
        for body in self.bodies.values():
            body.pause(reason)
        self._note("", "pause", reason)

    def reset(self, rebuild: bool = True) -> None:
        """Restores the world as it was built, to the last bit; stamps continue.

        Objects that were added later are removed, those that were removed are added again. Motions end with a reason;
        waiting inputs are dropped. Cameras keep their poses. Bodies and their sensors are new objects; gravity, the
        engine's parameters and rates are those of the configuration.

        Args:
            rebuild: Whether everything is loaded again in any case. Otherwise bodies stay the same objects where that
                is exact: if nothing happened since the start, except that robots without controllers followed targets,
                and that bodies were moved or changed in their dynamics. That takes less than a millisecond.

        Raises:
            ConfigError: If something cannot be loaded any more, for instance because its file is missing; then the
                world lacks it.
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
        """Returns to the start without loading anything; returns whether the start was reached exactly."""
        if self._start is None or self.pb.changes.unrecorded or not self._start.restore(self.commands):
            return False
        self.clock.restart()
        self.contacts.invalidate()
        self._sensors.restart()
        self.resets += 1
        self._forget_commands()
        return self.state_hash() == self.start_hash

    def _forget_commands(self) -> None:
        """Clears commands and waiting inputs; the poses that cameras keep become the first commands."""
        self.commands.clear()
        self.pb.changes.unrecorded = ""
        self.mailbox.drop()
        for slot, pose in self._contents.moved_cameras():
            self._note(slot, "input", pose)

    def describe(self) -> str:
        """Returns what it was built from, as JSON; see `WorldDescription`."""
        if not self._description:
            self._description = describe(self.loaded, self.start_hash)
        return self._description

    def keyframe(self, recorded: str = "") -> None:
        """Moves the world into a fresh client of PyBullet, so that the future depends on the present state alone.

        Commands before it are dropped: `save`, `restore`, `fork` and `predict` start from here. Bodies and sensors stay
        the same objects. When it raises, nothing has changed, except if it differs from the recorded one.

        Args:
            recorded: A keyframe of the same world at the same tick, which this one is compared with.

        Raises:
            InterfaceError: If the world has a window, a soft body, a body of another package, an object with a state
                that cannot be written, or a change that was not recorded; or if it differs from the recorded keyframe.
            ConfigError: If a body cannot be loaded any more, for instance because its file is missing.
        """
        for _ in self.keyframe_in_parts():
            pass
        if recorded and (part := difference(self._keyframe, recorded)):
            raise InterfaceError(f"the keyframe at tick {self.clock.tick} is not the recorded one: '{part}' differs")

    def keyframe_in_parts(self) -> Iterator[None]:
        """Does the same as `keyframe` in parts, one for each item; the world may step between them.

        Each part builds one body in the fresh client. All are built again if bodies are added, removed or changed
        meanwhile. The world moves in the last part.
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
        """Brings the world, which was just built or reset, to a keyframe.

        Args:
            keyframe: Its text.
            trust: Packages that it may import, see `from_description`.

        Raises:
            InterfaceError: If the text is no keyframe of such a world, or something in it cannot be loaded here.
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
        """Returns the present state, from which the same world continues to the last bit.

        Waiting inputs are applied first, as before the next step. The state holds all commands since the world was
        built or reset, or since its last keyframe. To restore it therefore takes as long as simulating again from
        there.

        Args:
            file: File to which it is written, too.
            keyframe: Whether a keyframe is made first, see `keyframe`; then the state holds no commands.

        Raises:
            InterfaceError: If the world has soft bodies, whose motion is not reproducible, a command that cannot be
                recorded, or a change that no command repeats.
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
        """Restores a saved state of the world; stamps continue.

        Args:
            state: The state.
            trust: Packages that its commands may import, see `from_description`.
            max_ticks: Age of a state beyond which it is refused.

        Raises:
            InterfaceError: If the state is of another world or too old; or if the world does not reach the same state
                again, then it is reset.
        """
        self.require_own(state)
        state.require_short(max_ticks)
        for _ in self.restoring(state, trust):
            pass

    def restoring(self, state: WorldState, trust: Collection[str] | None = ()) -> Generator[int, None, None]:
        """Does the same as `restore` in steps, for a state that was checked; yields each tick on the way.

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
        """Checks that a state is one of this world.

        Raises:
            InterfaceError: If it is of another world, or files have changed since.
        """
        if state.description not in (self.describe(), self._built_from):
            raise InterfaceError(
                "the state is of another world, or one of its files has changed: build that world by World.from_state"
            )

    def _require_recorded(self) -> None:
        """Checks that all changes were recorded.

        Raises:
            InterfaceError: If a call has changed PyBullet that no command repeats.
        """
        if name := self.pb.changes.unrecorded:
            raise InterfaceError(
                f"something not recorded acts: PyBullet's {name} was called since the last reset, by other means than "
                "the methods of World, such as put, act and change_dynamics"
            )

    def prepare_forks(self) -> None:
        """Starts the process from which `fork` and `predict` fork, so that their first call need not wait for it.

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
        """Returns worlds in processes of their own that continue from the present state, to the last bit.

        They are forked from a process that follows this world's commands. It is a copy of this one if this has only one
        thread; otherwise the first call takes as long as simulating again from the last reset.

        Raises:
            InterfaceError: If the state cannot be saved, or is not the same there.
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
        """Predicts what would happen from the present state, for each of several sequences of inputs.

        Args:
            candidates: The sequences: inputs by tick from now on. Motions under way continue.
            ticks: Number of ticks.
            watch: Bodies whose motion is returned; all by default.
            every: Number of ticks between two rows of it.
            cost: Cost of a state, which is summed over all ticks: a function of a module that takes the `World`, a
                class whose objects do, or `module:name` of either.
            jobs: Number of processes at a time; the number of processors by default.

        Raises:
            InterfaceError: If the state cannot be saved, or is not the same in another process.
            UnknownNameError: If a watched body is unknown.
            ValueError: If a number is not positive.
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
        """Yields the process that follows this world, at the present state; an error ends it."""
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
        """Returns the names of all objects that were added or removed since the world was built or reset."""
        return self._contents.changed_names()

    def state_hash(self) -> str:
        """Returns a text that is the same for worlds in the same state at the same tick, see `state_hash`."""
        return state_hash(self.clock.tick, self.bodies)

    def close(self) -> None:
        """Disconnects from PyBullet, closes all bodies and fails the waiting requests."""
        self.mailbox.close()
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
