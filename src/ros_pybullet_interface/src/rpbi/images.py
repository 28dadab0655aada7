"""Camera images as arrays, without ROS and without a renderer process, for scripts and notebooks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from custom_ros_tools.errors import UnknownNameError
from rpbi.render.camera import looking_at
from rpbi.render.frame import Camera, Frame
from rpbi.render.messages import DrawnScene
from rpbi.render.mirror import Mirror
from rpbi.render.renderers import Renderer, open_renderer

from .world.load_log import LoadLogReader

if TYPE_CHECKING:
    from rpbi.world import World

__all__ = ["CameraImages", "Frame", "looking_at"]

STREAMS = ("colour", "depth", "segmentation")


class CameraImages:
    """Draws what the cameras of a world see, in the thread that asks, which is always the same one.

    The renderer is opened when it is made, and draws the scene of the present tick, also while the world stands still.

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
        """Returns what a camera sees now, which need not be a tick at which it is due.

        Args:
            camera: Its name; the first one by default.

        Raises:
            UnknownNameError: If there is none of that name.
            ValueError: If nobody has put its pose yet.
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
