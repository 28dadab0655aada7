"""Adds and removes objects while the node runs, with their topics and services."""

import threading
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from typing import Any

from custom_ros_tools.errors import ConfigError, InterfaceError, Problem, UnknownNameError
from rpbi.bodies import BODY_TYPES
from rpbi.bodies.file_checks import check_files
from rpbi.config.sensors import RgbdSensorConfig
from rpbi.plugins import plugin_errors
from rpbi.ros.initial_state import with_initial_state
from rpbi.ros.inputs import Inputs
from rpbi.ros.publishers.sample_publishers import SamplePublishers
from rpbi.ros.requests import Requests
from rpbi.ros.services.body_endpoints import BodyEndpoints
from rpbi.ros.simulation import Simulation
from rpbi.ros.state_topic import FastTopic
from rpbi.sensors.rgbd import RgbdSensor
from rpbi.world.saved.state import MAX_TICKS, WorldState


class ObjectLifecycle:
    """Adds and removes objects, and resets the world, one operation at a time.

    The constructor opens the topics and services of all objects in the world. Any thread except the simulation thread
    may call the methods.
    """

    def __init__(self, simulation: Simulation, ask: Requests, publishers: SamplePublishers) -> None:
        self._world, self._simulation, self._ask = simulation.world, simulation, ask
        self._publishers = publishers
        self._inputs = Inputs(self._world)
        self._endpoints = BodyEndpoints(simulation, ask)
        self._lock = threading.Lock()
        self._open_bodies: set[str] = set()
        self._placed_cameras: Mapping[str, RgbdSensor] = {}
        self._place_cameras()
        for name in self._world.bodies:
            self._open(name)

    def add(self, kind: str, config: Any, file: str) -> None:
        """Adds a body and opens its topics and services.

        Args:
            kind: Type of the body, a key of BODY_TYPES.
            config: Configuration of the body.
            file: Name of the body's YAML file, for error messages.

        Raises:
            InterfaceError: If the body cannot be created, or its topics cannot be opened; the body is removed again.
        """
        with self._alone():
            config = with_initial_state(config, file)
            self._prepare(kind, config, file)  # here, since reading large files would delay the simulation thread
            self._ask(lambda: self._add_body(kind, config, file))
            try:
                self._open(config.name)
            except Exception as error:
                self._withdraw(config.name)
                raise InterfaceError(f"{config.name}: its topics could not be opened: {error}") from error

    def add_camera(self, config: RgbdSensorConfig, file: str) -> None:
        """Adds a camera.

        Raises:
            ConfigError: If an object or camera of the same name exists.
        """
        with self._alone():
            self._ask(lambda: self._world.add_camera(config, file))
            self._place_cameras()

    def remove(self, name: str) -> None:
        """Removes a body or a camera.

        Raises:
            UnknownNameError: If neither a body nor a camera has that name.
        """
        with self._alone():
            if name in self._world.cameras:
                self._ask(lambda: self._world.remove(name))
                self._place_cameras()
            elif name in self._world.bodies:
                self._withdraw(name)
            else:
                raise UnknownNameError("object", name, [*self._world.bodies, *self._world.cameras])

    def reset(self, to: WorldState | None = None) -> None:
        """Resets the world or restores a saved state, and waits until the reset or restoration is complete.

        Topics and services of bodies that the reset or restoration keeps stay open.

        Args:
            to: The saved state to restore; None resets the world to its initial state.

        Raises:
            InterfaceError: If an object can no longer be loaded, the state belongs to another world, or the state
                cannot be reached.
        """
        with self._alone():
            for name in self._ask(self._world.changed_names):
                self._inputs.close(name)
            changed, topics, error, restored = self._ask(lambda: self._start_again(to))
            if restored is not None:
                try:
                    self._ask.wait_for(restored)
                except InterfaceError as problem:
                    error = problem
            lost = self._open_bodies - changed - self._world.bodies.keys()
            topics += self._ask(lambda: self._forget(lost))
            for topic in topics:
                topic.close()
            for name in changed | lost:
                self._close(name)
            for name in self._world.bodies:
                if name not in self._open_bodies:
                    self._open(name)
            self._place_cameras()
            if error is not None:
                raise error

    def end(self, timeout_s: float) -> None:
        """Waits at most `timeout_s` [s] until the running operation ends; operations called later never start."""
        self._lock.acquire(timeout=timeout_s)

    def _prepare(self, kind: str, config: Any, file: str) -> None:
        try:
            check_files(config)
        except ConfigError as error:
            raise ConfigError([Problem(file, each.key, each.message) for each in error.problems]) from None
        body_type = BODY_TYPES.find(kind)
        with (
            plugin_errors(body_type, f"preparing '{config.name}'"),
            suppress(ConfigError),
        ):  # creating the body reports the error
            body_type.prepare(config, self._world.window is not None)

    def _add_body(self, kind: str, config: Any, file: str) -> None:
        """Adds a body to the world and finds its topics; runs in the simulation thread."""
        self._world.add(kind, config, file)
        try:
            self._publishers.find_topics(config.name)
        except InterfaceError:
            self._world.remove(config.name)
            raise

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Context manager that waits for other operations; later operations wait until the context is left.

        Raises:
            InterfaceError: If a state is being restored.
        """
        self._ask(lambda: None)
        with self._lock:
            yield

    def _forget(self, names: Iterable[str]) -> list[FastTopic]:
        return [topic for name in names for topic in self._publishers.forget(name)]

    def _start_again(
        self, to: WorldState | None
    ) -> tuple[set[str], list[FastTopic], InterfaceError | None, Future[None] | None]:
        """Resets the world, or starts to restore a saved state; runs in the simulation thread.

        Returns:
            Names of the bodies that were added or removed since the world was last built or reset.
            Topics of these bodies, which the caller must close.
            Error of the reset, or None.
            Future of the restoration if a saved state is restored, otherwise None.
        """
        if to is not None:
            self._world.require_own(to)
            to.require_short(MAX_TICKS)
        changed = self._world.changed_names()
        for name in changed & self._world.bodies.keys():
            self._world.remove(name)
        topics = self._forget(changed)
        if to is not None:
            return changed, topics, None, self._simulation.restore(to)
        try:
            self._simulation.reset(self._inputs.repeat_poses)
        except InterfaceError as error:
            return changed, topics, error, None
        return changed, topics, None, None

    def _place_cameras(self) -> None:
        """Starts to follow the TF frames of new cameras, and stops following the TF frames of removed cameras."""
        cameras = self._world.cameras
        for name, camera in self._placed_cameras.items():
            if cameras.get(name) is not camera:
                self._inputs.close(name)
        for name, camera in cameras.items():
            if self._placed_cameras.get(name) is not camera:
                self._inputs.open(name, camera.inputs())
        self._placed_cameras = cameras

    def _open(self, name: str) -> None:
        """Opens the topics and services of a body."""
        body = self._world.bodies[name]
        self._open_bodies.add(name)
        self._publishers.open(name)  # first, as it stores which samples to drop if one of the others fails
        self._inputs.open(name, body.inputs())
        self._endpoints.open(body)

    def _close(self, name: str) -> None:
        """Closes the inputs and services of a body; its sample topics stay open."""
        self._open_bodies.discard(name)
        self._inputs.close(name)
        self._endpoints.close(name)

    def _withdraw(self, name: str) -> None:
        """Closes the inputs of a body, removes the body from the world, then closes its topics and services."""
        self._inputs.close(name)
        for topic in self._ask(lambda: self._remove_body(name)):
            topic.close()
        self._close(name)

    def _remove_body(self, name: str) -> list[FastTopic]:
        """Removes a body from the world in the simulation thread; returns the topics that the caller must close."""
        self._world.remove(name)
        return self._publishers.forget(name)
