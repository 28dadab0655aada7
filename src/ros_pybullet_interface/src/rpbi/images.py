"""Renders camera images as arrays in scripts and notebooks, without ROS and without a renderer process."""

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
"""Number of timed images per camera, after one image that also loads the scene."""
LONGEST_S = 60.0
"""Longest wall time [s] of the measurement of drawing times."""


class CameraImages:
    """Renders the cameras of a world at its present tick, also while the world is stopped.

    The constructor opens the renderer. All calls must come from the same thread.

    Args:
        world: The world, with at least one camera.
        use_egl: Whether to render with EGL, which is faster on a graphics card. A faulty driver may crash the process.
    """

    def __init__(self, world: World, use_egl: bool = False) -> None:
        self._world = world
        self._unread = LoadLogReader(world.log)
        self._renderer = open_renderer([Camera.of(sensor.config) for sensor in world.cameras.values()], use_egl)
        self._mirror = Mirror(self._renderer.pb)

    @property
    def renderer(self) -> Renderer:
        """The renderer, whose PyBullet client holds a copy of the world."""
        return self._renderer

    def frame(self, camera: str = "") -> Frame:
        """Applies the world's waiting inputs, and renders an image of a camera at the present tick.

        The camera's configured rate is ignored.

        Args:
            camera: Name of the camera; empty for the first one.

        Raises:
            UnknownNameError: If there is no camera with this name.
            ValueError: If the camera's pose is unknown.
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
        """Closes the renderer, and deletes the temporary mesh files of the renderer's copy of the world."""
        self._mirror.close()
        self._renderer.pb.disconnect()

    def __enter__(self) -> CameraImages:
        """Returns itself; the end of the `with` block calls `close`."""
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def drawing_times(world: World) -> dict[str, float]:
    """Measures how much processor time this machine needs to render an image of each camera.

    The processor time of all threads is divided by the number of processors. The result hardly depends on other
    programs, and never exceeds the wall time of rendering. The images are rendered in a forked process, since a
    graphics driver may crash. Cameras with an unknown pose are placed at the origin of the world.

    Returns:
        Times [s], keyed by camera name; empty if they cannot be measured within `LONGEST_S`.
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
