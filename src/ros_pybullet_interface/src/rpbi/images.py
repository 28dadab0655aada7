"""Camera images as arrays, without ROS and without a renderer process, for scripts and notebooks."""

from __future__ import annotations

import json
import os
import select
import signal
import time
from typing import TYPE_CHECKING

from custom_ros_tools.errors import UnknownNameError
from rpbi.render.camera import looking_at
from rpbi.render.channel import DrawnScene
from rpbi.render.frame import Camera, Frame
from rpbi.render.mirror import Mirror
from rpbi.render.renderers import Renderer, open_renderer

from .geometry import Pose
from .world.load_log import LoadLogReader

if TYPE_CHECKING:
    from rpbi.world import World

__all__ = ["CameraImages", "Frame", "drawing_times", "looking_at"]

STREAMS = ("colour", "depth", "segmentation")
TRIES = 3
"""Images of each camera that are timed; the first one also loads what is drawn."""
LONGEST_S = 60.0
"""Time [s] after which images are not timed."""


class CameraImages:
    """Renders the cameras of a world in the calling thread, which must always be the same.

    The renderer is opened on construction, and draws the scene of the present tick, also while the world is stopped.

    Args:
        world: The world, with one camera or more.
        use_egl: Whether to draw by EGL, which is faster where there is a graphics card. A driver that fails may end the
            process.
    """

    def __init__(self, world: World, use_egl: bool = False) -> None:
        self._world = world
        self._unread = LoadLogReader(world.log)
        self._renderer = open_renderer([Camera.of(sensor.config) for sensor in world.cameras.values()], use_egl)
        self._mirror = Mirror(self._renderer.pb)

    @property
    def renderer(self) -> Renderer:
        """The renderer, whose client has a copy of the world."""
        return self._renderer

    def frame(self, camera: str = "") -> Frame:
        """Returns the present frame of a camera, also at ticks at which the camera is not due.

        Args:
            camera: Its name; the first one by default.

        Raises:
            UnknownNameError: If there is none of that name.
            ValueError: If its pose is unknown.
        """
        world = self._world
        world.apply_inputs()
        name = camera or next(iter(world.cameras), "")
        if name not in world.cameras:
            raise UnknownNameError("camera", name, list(world.cameras))
        sensor = world.cameras[name]
        sample = sensor.read(world.clock.tick)
        if sample is None:
            raise ValueError(f"where is '{name}'? Put its pose into '{name}/pose'")
        for entry in self._unread.drain():
            self._mirror.apply(entry)
        known = Camera.of(sensor.config, sensor.topic_name)
        self._renderer.make_room(known.intrinsics)
        body_ids = {name: body.body_id for name, body in world.bodies.items()}
        return self._mirror.frame(self._renderer, DrawnScene(sample, body_ids), known, STREAMS)

    def close(self) -> None:
        """Disconnects from PyBullet and deletes the files that it made."""
        self._mirror.close()
        self._renderer.pb.disconnect()

    def __enter__(self) -> CameraImages:
        """Closes itself at the end of a `with` block."""
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def drawing_times(world: World) -> dict[str, float]:
    """Returns the processor time [s] that an image takes on this machine, by camera, divided among its processors.

    It hardly depends on what else runs, and never exceeds the time that drawing takes.

    A fork of this process draws, since a driver may end it. Cameras whose pose is unknown look from the origin.

    Returns:
        Times of all cameras; none if they cannot be measured within `LONGEST_S`.
    """
    if not world.cameras:
        return {}
    reading, writing = os.pipe()
    if not (child := os.fork()):
        try:
            os.write(writing, json.dumps(_measured(world)).encode())
        finally:
            os._exit(0)
    os.close(writing)
    try:
        is_ready = select.select([reading], [], [], LONGEST_S)[0]
        return dict(json.loads(os.read(reading, 1 << 16) or b"{}")) if is_ready else {}
    finally:
        os.close(reading)
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)


def _measured(world: World) -> dict[str, float]:
    times: dict[str, float] = {}
    processors = len(os.sched_getaffinity(0))
    with CameraImages(world, use_egl=True) as images:
        for name, sensor in world.cameras.items():
            sensor.pose = sensor.pose or Pose()
            for attempt in range(1 + TRIES):
                start_s = time.process_time()
                images.frame(name)
                if attempt:
                    used_s = (time.process_time() - start_s) / processors
                    times[name] = min(times.get(name, LONGEST_S), used_s)
    return times
