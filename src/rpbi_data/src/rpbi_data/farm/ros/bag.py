"""Writes the bag of an episode directly from the simulated world, without a ROS master."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any

import rosbag
from std_msgs.msg import Header, String

from custom_ros_tools.errors import InterfaceError
from rpbi.engine.clock import Schedule
from rpbi.images import CameraImages
from rpbi.render.frame import Camera
from rpbi.ros.cameras.topics import camera_info, compressed_message
from rpbi.ros.headers import named_frame, to_ros_time
from rpbi.ros.inputs import input_messages
from rpbi.ros.publishers.commands import COMMANDS, DESCRIPTION, commands_message
from rpbi.ros.publishers.status import CLOCK, FREE_RUNNING_CLOCK_HZ, STATE, clock_message, state_message
from rpbi.ros.publishers.transforms import TF_STATIC, static_frames_message
from rpbi.world import World
from rpbi_data.episodes.config import DEFAULT_TOPICS
from rpbi_data.episodes.sample_messages import SampleMessages


class EpisodeBag:
    """Writes the bag of an episode, with the topics that the episode recorder records by default.

    Used as a context manager, which closes the bag. All configured rates apply to simulated time.

    Args:
        path: Path of the new bag file.
        world: The world at tick 0.
        images: Whether the colour images of the world's cameras are written as JPEG, too.

    Raises:
        OSError: If the bag cannot be written. All methods may raise this error.
    """

    def __init__(self, path: Path, world: World, images: bool = False) -> None:
        self._world = world
        config, dt_ns = world.config, world.clock.dt_ns
        self._hashes = Schedule(config.state_hash_hz, dt_ns) if config.state_hash_hz else None
        self._states = Schedule(config.state_hz, dt_ns) if config.state_hz else None
        self._clock = Schedule(config.clock_hz or FREE_RUNNING_CLOCK_HZ, dt_ns)
        self._samples = SampleMessages(world, lambda topic: _RECORDED.fullmatch(_full(topic)) is not None)
        self._commands = 0
        self._images = _Images(world) if images else None
        self._bag = rosbag.Bag(str(path), "w", compression="lz4")

    def __enter__(self) -> EpisodeBag:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if self._images is not None:
            self._images.close()
        try:
            self._bag.close()
        except Exception:
            if error is None:  # otherwise, this exception is a consequence of `error`
                raise

    def start(self) -> None:
        """Writes the messages about the world at tick 0, such as its description, static frames and state."""
        self._write(DESCRIPTION.name, String(self._world.describe()))
        if self._world.config.poses:
            self._write(TF_STATIC.name, static_frames_message(self._world.config.poses))
        self._write_clock()
        self.before_step()
        self._write_state(with_hash=True)
        self._write_samples(self._world.read_rest())
        self._write_images()

    def before_step(self) -> None:
        """Writes the commands that the world has recorded since the last call.

        Targets are also written to the topics on which the simulator's node would receive them.

        Raises:
            InterfaceError: If a command cannot be recorded.
        """
        world = self._world
        while self._commands < world.commands.count:
            first, commands = world.commands.since(self._commands)
            message = commands_message(world, first)
            if unrecorded := next((each for each in message.commands if not each.data), None):
                raise InterfaceError(f"command '{unrecorded.what}' of '{unrecorded.name}' cannot be recorded")
            self._commands = first + len(message.commands)
            self._write(COMMANDS.name, message)
            for command in commands[: len(message.commands)]:
                if command.what == "input":
                    for topic, target in input_messages(world, command.name, command.value):
                        self._write(topic, target)

    def after_step(self, samples: list[Any]) -> None:
        """Writes the sensor samples of the present tick, and the clock, images and state if due at this tick."""
        tick = self._world.clock.tick
        if self._clock.is_due(tick):
            self._write_clock()
        self._write_samples(samples)
        self._write_images()
        with_hash = self._hashes is not None and self._hashes.is_due(tick)
        if with_hash or (self._states is not None and self._states.is_due(tick)):
            self._write_state(with_hash)

    def end(self) -> None:
        """Writes the remaining messages of the last tick, including the hash of the world's state.

        Raises:
            InterfaceError: If the pose of a camera was never set, so that it has no image.
        """
        if self._images is not None:
            self._images.require_all()
        self.before_step()
        self._write_clock()
        self._write_samples(self._world.read_rest())
        self._write_state(with_hash=True)

    def _write_clock(self) -> None:
        self._write(CLOCK.name, clock_message(self._world.clock.stamp_ns))

    def _write_state(self, with_hash: bool) -> None:
        self._write(STATE.name, state_message(self._world, with_hash, running=True))

    def _write_samples(self, samples: list[Any]) -> None:
        for topic, message in self._samples.of(samples, self._world.clock.stamp_ns):
            self._write(topic, message)

    def _write_images(self) -> None:
        if self._images is not None:
            for topic, message in self._images.due():
                self._write(topic, message)

    def _write(self, topic: str, message: Any) -> None:
        self._bag.write(_full(topic), message, to_ros_time(self._world.clock.stamp_ns))


class _Images:
    """Draws the colour images of a world's cameras at the configured rates."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._schedules = {name: Schedule(each.hz, world.clock.dt_ns) for name, each in world.cameras.items()}
        self._missing = set(self._schedules)
        self._drawn = CameraImages(world)

    def due(self) -> Iterator[tuple[str, Any]]:
        """Yields topics and messages of the cameras that are due at the present tick; skips cameras without a pose."""
        tick, stamp = self._world.clock.tick, to_ros_time(self._world.clock.stamp_ns)
        for name, schedule in self._schedules.items():
            camera = self._world.cameras[name]
            if camera.pose is None or not (tick == 0 or schedule.is_due(tick)):
                continue
            self._missing.discard(name)
            header = Header(stamp=stamp, frame_id=named_frame(camera.config.object_tf.tf_id))
            known = Camera.of(camera.config, camera.topic_name)
            info, jpeg = camera_info(known), compressed_message(self._drawn.frame(name), header)
            info.header = header
            yield f"rpbi/{camera.topic_name}/colour/camera_info", info
            yield f"rpbi/{camera.topic_name}/colour/image/compressed", jpeg

    def require_all(self) -> None:
        """Raises an `InterfaceError` if a camera has not drawn an image."""
        for name in sorted(self._missing):
            where = f"expected its frame in `poses`, or its pose from the policy: world.put('{name}/pose', pose)"
            raise InterfaceError(f"camera '{name}' has no image: {where}")

    def close(self) -> None:
        """Closes the renderer."""
        self._drawn.close()


_RECORDED = re.compile(DEFAULT_TOPICS)


def _full(topic: str) -> str:
    return f"/{topic.lstrip('/')}"
