"""The renderers of PyBullet: the fast one by EGL, and the one in plain software that always works."""

from __future__ import annotations

import importlib.util
import logging
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from ..camera import Intrinsics, view_matrix
from ..client import Client
from ..pose import Pose
from .egl import Egl, EglError
from .frame import Camera

log = logging.getLogger(__name__)


class Drawing(NamedTuple):
    """What PyBullet drew.

    Attributes:
        rgba: Shape (height, width, 4), uint8.
        depth_buffer: Shape (height, width), float32; 0 at the near and 1 at the far plane.
        body_ids: Ids in the client that drew, -1 where nothing is; int32. Without meaning if not asked for.
    """

    rgba: npt.NDArray[np.uint8]
    depth_buffer: npt.NDArray[np.float32]
    body_ids: npt.NDArray[np.int32]


class Renderer(Protocol):
    """Draws what is in its client.

    Attributes:
        name: What it is, for people.
        pb: The client, empty at first.
    """

    name: str
    pb: Client

    def draw(self, intrinsics: Intrinsics, camera: Pose, segmentation: bool = True) -> Drawing:
        """Draws what a camera sees.

        Args:
            intrinsics: The camera.
            camera: Pose of its optical frame in the world.
            segmentation: Whether to tell bodies apart, which costs a second pass.
        """


class TinyRenderer:
    """PyBullet's software renderer.

    It samples each pixel at its upper left corner, not at its centre, and the rows a pixel lower, so its
    image would be half a pixel to the right and up of what K says. The projection is shifted by as much the
    other way.
    """

    name = "TinyRenderer"

    def __init__(self) -> None:
        self.pb = Client()

    def draw(self, intrinsics: Intrinsics, camera: Pose, segmentation: bool = True) -> Drawing:
        """Draws what a camera sees; segmentation is free here."""
        projection = intrinsics.projection
        projection[0, 2] += 1.0 / intrinsics.width_px
        projection[1, 2] += 1.0 / intrinsics.height_px
        return _draw(self.pb, intrinsics, projection, camera, renderer=self.pb.ER_TINY_RENDERER)


class EglRenderer:
    """OpenGL without a screen, on the graphics card or, by Mesa's llvmpipe, on all cores.

    All its calls must come from the thread that made it.

    Args:
        cameras: All cameras that will draw.

    Raises:
        EglError: If it cannot be loaded or does not draw as it should. Some failures end the process instead.
    """

    def __init__(self, cameras: Sequence[Camera]) -> None:
        plugin = importlib.util.find_spec("eglRenderer")
        if plugin is None or plugin.origin is None:
            raise EglError("PyBullet came without its EGL plugin")
        self.pb = Client()
        if self.pb.loadPlugin(plugin.origin, "_eglRendererPlugin") < 0:
            raise EglError("PyBullet does not load its EGL plugin")
        egl = Egl()
        self.name = f"EGL ({egl.renderer()})"
        sizes = [(camera.intrinsics.width_px, camera.intrinsics.height_px) for camera in cameras]
        try:
            egl.deepen(*(max(side) for side in zip(*sizes)))
        except EglError as error:
            log.warning("depth images have 16 bits only: %s", error)
        _check(self)

    def draw(self, intrinsics: Intrinsics, camera: Pose, segmentation: bool = True) -> Drawing:
        """Draws what a camera sees."""
        flags = 0 if segmentation else self.pb.ER_NO_SEGMENTATION_MASK
        hardware = self.pb.ER_BULLET_HARDWARE_OPENGL
        return _draw(self.pb, intrinsics, intrinsics.projection, camera, renderer=hardware, flags=flags)


def open_renderer(cameras: Sequence[Camera], use_egl: bool = True) -> Renderer:
    """Returns the fastest renderer that works, with a client of its own.

    Args:
        cameras: All cameras that will draw.
        use_egl: Whether to try EGL at all.
    """
    if use_egl and cameras:
        try:
            return EglRenderer(cameras)
        except EglError as error:
            log.warning("EGL does not work: %s", error)
    return TinyRenderer()


def _draw(pb: Client, intrinsics: Intrinsics, projection: Any, camera: Pose, **options: Any) -> Drawing:
    width, height = intrinsics.width_px, intrinsics.height_px
    # PyBullet takes matrices column by column.
    view = view_matrix(camera).T.ravel().tolist()
    image = pb.getCameraImage(width, height, view, projection.T.ravel().tolist(), **options)
    rgba = np.asarray(image[2], np.uint8).reshape(height, width, 4)
    depth_buffer = np.asarray(image[3], np.float32).reshape(height, width)
    return Drawing(rgba, depth_buffer, np.asarray(image[4], np.int32).reshape(height, width))


def _check(renderer: Renderer, distance_m: float = 1.0) -> None:
    """Draws a red wall that fills the view, and looks whether it is there."""
    pb = renderer.pb
    shape = pb.createVisualShape(pb.GEOM_BOX, halfExtents=[1.0, 1.0, 0.1], rgbaColor=[1.0, 0.0, 0.0, 1.0])
    wall = pb.createMultiBody(0.0, -1, shape, [0.0, 0.0, distance_m + 0.1])
    intrinsics = Intrinsics(width_px=64, height_px=48, near_m=0.1, far_m=10.0)
    drawing = renderer.draw(intrinsics, Pose())
    pb.removeBody(wall)
    red, green, blue = drawing.rgba[..., :3].reshape(-1, 3).mean(axis=0)
    problem: str | None = None
    if not (drawing.body_ids == wall).all():
        problem = "does not tell bodies apart"
    elif not red > 2 * max(green, blue):
        problem = "shows wrong colours"
    if problem:
        raise EglError(f"a test image {problem}")
