"""Content of a live view that is read from a world, while a script or a notebook steps the world."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from robot_model.geometry import Pose
from rpbi.bodies.visual_shapes import body_shapes, link_pose
from rpbi.config.world import WORLD_FRAME
from rpbi.images import CameraImages
from rpbi.render.frame import Camera
from rpbi.sensors.contacts.arrows import ContactArrowsSensor
from rpbi.sensors.surface import SurfaceSensor
from rpbi.world import World

from .live_view import FRAMES_HZ
from .moment import CameraItem, Item, LinesItem, Moment, Name, Placed, ShapeItem, SurfaceItem, is_finite
from .scene import Array

SURFACES_HZ, IMAGES_HZ = 10.0, 5.0
"""Rates of surfaces of soft bodies, and of images, in wall time [Hz]."""
ARROW_M, ARROW_RGBA = 0.012, (0.84, 0.15, 0.16, 1.0)
CAMERA, CONTACTS, SURFACE = "camera", "contacts", "surface"


class Due:
    """Returns, when called, whether a period of wall time has passed since the last time that it returned True."""

    def __init__(self, hz: float) -> None:
        self._period_s, self._due_s = 1.0 / hz, -math.inf

    def __call__(self) -> bool:
        now_s = time.monotonic()
        if now_s < self._due_s:
            return False
        self._due_s = now_s + self._period_s
        return True


class WorldSource:
    """Reads frames and items from a world. Only `update` and `close` must be called in the thread of the world."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._seen: tuple[object, ...] = ()
        self._shapes: dict[Name, Item] = {}
        self._surfaces: dict[Name, Item] = {}
        self._is_frame_due, self._is_surface_due, self._is_image_due = map(Due, (FRAMES_HZ, SURFACES_HZ, IMAGES_HZ))
        self._moment = Moment(time.monotonic(), 0.0, WORLD_FRAME, {}, {})
        self._renderer: CameraImages | None = None
        self._wanted = ""
        self._picture: tuple[float, Array | None, Name | None] = (0.0, None, None)
        self.images: Sequence[str] = ()
        self.camera = world.config.resetDebugVisualizerCamera

    def moment(self) -> Moment:
        """Returns the content at the last update."""
        return replace(self._moment, wall_s=time.monotonic())

    def choose_image(self, name: str) -> None:
        """Chooses a camera."""
        self._wanted = name

    def picture(self) -> tuple[float, Array | None, Name | None]:
        """Returns the last image of the chosen camera."""
        return self._picture

    def update(self) -> None:
        """Reads the world, if a frame is due."""
        if not self._is_frame_due():
            return
        world = self._world
        present = (len(world.log), *world.bodies.values())
        if present != self._seen:
            self._seen = present
            self._shapes = {**dict(self._all_shapes()), **dict(self._all_cameras())}
            self._surfaces = {}
        if self._is_surface_due():
            self._surfaces = dict(self._all_surfaces())
        frames = dict(self._frames())
        items = {**self._shapes, **self._surfaces, **dict(self._arrows())}
        self._moment = Moment(time.monotonic(), world.clock.time_s, WORLD_FRAME, frames, items)
        self.images = tuple(world.cameras)
        if self._wanted in world.cameras and self._is_image_due():
            self._draw(self._wanted)

    def close(self) -> None:
        """Ends the renderer."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _all_shapes(self) -> Any:
        for body in self._world.bodies.values():
            for number, shape in enumerate(body_shapes(body)):
                frame = f"{body.name}/{shape.link}"
                yield (body.name, str(number)), ShapeItem(frame, shape.pose_in_link, shape)

    def _all_surfaces(self) -> Any:
        for body in self._world.bodies.values():
            if body.is_soft:
                sample = SurfaceSensor(body, SURFACES_HZ).read(self._world.clock.tick)
                corners = np.array(sample.corners, np.float32)
                yield (body.name, SURFACE), SurfaceItem(WORLD_FRAME, Pose(), corners, sample.rgba)

    def _frames(self) -> Any:
        links = {
            item.frame: (name[0], item.shape.link_index)
            for name, item in self._shapes.items()
            if isinstance(item, ShapeItem)
        }
        for frame, (body, index) in links.items():
            pose = Pose(*link_pose(self._world.bodies[body], index))
            if is_finite(pose):
                yield frame, Placed(WORLD_FRAME, pose)
        for name, camera in self._world.cameras.items():
            if camera.pose is not None:
                yield f"{CAMERA}/{name}", Placed(WORLD_FRAME, Pose(*camera.pose))

    def _arrows(self) -> Any:
        for name in self._world.bodies:
            for sensor in self._world.sensors_of(name):
                if isinstance(sensor, ContactArrowsSensor):
                    arrows = sensor.read(self._world.clock.tick).arrows
                    points = np.array(arrows, np.float32).reshape(-1, 2, 3)
                    yield (name, CONTACTS), LinesItem(WORLD_FRAME, Pose(), points, ARROW_RGBA, ARROW_M, True)

    def _all_cameras(self) -> Any:
        for name, camera in self._world.cameras.items():
            intrinsics = Camera.of(camera.config).intrinsics
            fov_rad = 2.0 * math.atan(intrinsics.height_px / 2.0 / intrinsics.K[1][1])
            aspect = intrinsics.width_px / intrinsics.height_px
            yield (CAMERA, name), CameraItem(f"{CAMERA}/{name}", Pose(), fov_rad, aspect)

    def _draw(self, camera: str) -> None:
        self._renderer = self._renderer or CameraImages(self._world)
        try:
            pixels = self._renderer.frame(camera).colour
        except ValueError:  # its pose is unknown
            pixels = None
        self._picture = time.monotonic(), pixels, (CAMERA, camera)
