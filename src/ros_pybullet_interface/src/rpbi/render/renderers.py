"""The renderers of PyBullet: the fast one by EGL, and the one in plain software that always works."""

import importlib.util
import logging
from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from robot_model.geometry import Pose
from rpbi.engine.client import Client

from .camera import Intrinsics, view_matrix
from .egl import Egl, EglError
from .frame import Camera

log = logging.getLogger(__name__)


class TransparentShape(NamedTuple):
    """A shape that is neither opaque nor invisible.

    Attributes:
        body_id: Its body in the renderer's client.
        link_index: Its link, -1 for the base.
        shape_index: Its place among the shapes of that link.
        rgba: Its colour and opacity, each from 0 to 1.
    """

    body_id: int
    link_index: int
    shape_index: int
    rgba: tuple[float, float, float, float]


class Transparency:
    """Tracks the transparent shapes of bodies that are added and removed.

    PyBullet's EGL plugin still reports the shapes of removed bodies, before those of later bodies with the same id.
    """

    def __init__(self, pb: Client) -> None:
        self._pb = pb
        self._stale = {0: len(pb.getVisualShapeData(0))}  # the renderer has drawn a test image
        self._shapes_of: dict[int, tuple[TransparentShape, ...]] = {}
        self.shapes: tuple[TransparentShape, ...] = ()
        """All transparent shapes."""

    def update(self, body_ids: set[int]) -> None:
        """Updates the set of bodies."""
        for body_id in self._shapes_of.keys() - body_ids:
            del self._shapes_of[body_id]
            self._stale[body_id] = len(self._pb.getVisualShapeData(body_id))
        for body_id in body_ids - self._shapes_of.keys():
            self._shapes_of[body_id] = tuple(self._transparent_shapes(body_id))
        self.shapes = tuple(shape for shapes in self._shapes_of.values() for shape in shapes)

    def _transparent_shapes(self, body_id: int) -> list[TransparentShape]:
        found = []
        count: Counter[int] = Counter()
        for data in self._pb.getVisualShapeData(body_id)[self._stale.get(body_id, 0) :]:
            link_index, rgba = data[1], data[7]
            if 0.0 < rgba[3] < 1.0:
                found.append(TransparentShape(body_id, link_index, count[link_index], rgba))
            count[link_index] += 1
        return found


Shapes = Sequence[TransparentShape]
_LINK_SHIFT = 24
"""Shift of the link in PyBullet's number of a body and a link: `body + ((link + 1) << 24)`."""


class Drawing(NamedTuple):
    """Buffers that PyBullet drew.

    Attributes:
        rgba: Shape (height, width, 4), uint8.
        depth_buffer: Shape (height, width), float32; 0 at the near and 1 at the far plane.
        body_ids: Ids in the client that drew, -1 where nothing is; int32. Without meaning if not asked for.
    """

    rgba: npt.NDArray[np.uint8]
    depth_buffer: npt.NDArray[np.float32]
    body_ids: npt.NDArray[np.int32]


class Renderer(Protocol):
    """Draws the bodies of its client.

    A transparent shape tints what is behind it in the colours; depth and segmentation are of the shape itself, so that
    all images of a frame show the same bodies.

    Attributes:
        name: Its name, for people.
        pb: The client, empty at first.
    """

    name: str
    pb: Client

    def make_room(self, intrinsics: Intrinsics) -> None:
        """Prepares for a camera that is new."""

    def draw(
        self, intrinsics: Intrinsics, camera: Pose, segmentation: bool = True, transparent: Shapes = ()
    ) -> Drawing:
        """Draws the image of a camera.

        Args:
            intrinsics: The camera.
            camera: Pose of its optical frame in the world.
            segmentation: Whether to draw body ids, in a second pass.
            transparent: The transparent shapes, which need a second pass too.
        """


class TinyRenderer:
    """PyBullet's software renderer.

    It samples each pixel at its upper left corner, not at its centre, and the rows a pixel lower, so its
    image would be half a pixel to the right and up of that by K. The projection is shifted by as much the
    other way.
    """

    name = "TinyRenderer"

    def __init__(self) -> None:
        self.pb = Client()

    def make_room(self, intrinsics: Intrinsics) -> None:
        """Does nothing."""

    def draw(
        self, intrinsics: Intrinsics, camera: Pose, segmentation: bool = True, transparent: Shapes = ()
    ) -> Drawing:
        """Draws the image of a camera; segmentation costs nothing extra here.

        It draws transparent shapes as if they were opaque, so they are blended with a second image without them. Glass
        behind glass does not show.
        """
        projection = intrinsics.projection
        projection[0, 2] += 1.0 / intrinsics.width_px
        projection[1, 2] += 1.0 / intrinsics.height_px
        how: dict[str, Any] = {"renderer": self.pb.ER_TINY_RENDERER}
        if not transparent:
            return _draw(self.pb, intrinsics, projection, camera, **how)
        with_links = {**how, "flags": self.pb.ER_SEGMENTATION_MASK_OBJECT_AND_LINKINDEX}
        drawing = _draw(self.pb, intrinsics, projection, camera, **with_links)
        self._set_opacity(transparent, 0.0)
        behind = _draw(self.pb, intrinsics, projection, camera, **how)
        self._set_opacity(transparent)
        rgba = drawing.rgba.copy()
        for shape in transparent:
            seen = drawing.body_ids == shape.body_id + ((shape.link_index + 1) << _LINK_SHIFT)
            opacity = shape.rgba[3]
            rgba[seen] = np.rint(opacity * drawing.rgba[seen] + (1.0 - opacity) * behind.rgba[seen])
        nothing = drawing.body_ids < 0
        body_ids = np.where(nothing, -1, drawing.body_ids & ((1 << _LINK_SHIFT) - 1)).astype(np.int32)
        return Drawing(rgba, drawing.depth_buffer, body_ids)

    def _set_opacity(self, transparent: Shapes, opacity: float | None = None) -> None:
        for body_id, link_index, shape_index, rgba in transparent:
            colour = [*rgba[:3], rgba[3] if opacity is None else opacity]
            self.pb.changeVisualShape(body_id, link_index, shape_index, rgbaColor=colour)


class EglRenderer:
    """OpenGL without a screen, on the graphics card or, by Mesa's llvmpipe, on all cores.

    All its calls must come from the thread that made it.

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
        self._egl = Egl()
        self.name = f"EGL ({self._egl.renderer()})"
        sizes = [(camera.intrinsics.width_px, camera.intrinsics.height_px) for camera in cameras]
        self._width_px, self._height_px = (max(side) for side in zip(*sizes))
        try:
            self._egl.deepen(self._width_px, self._height_px)
        except EglError as error:
            log.warning("depth images have 16 bits only: %s", error)
        _check(self)

    def make_room(self, intrinsics: Intrinsics) -> None:
        """Makes the surface that is drawn to large enough.

        Raises:
            EglError: If EGL has none of that size.
        """
        width_px, height_px = max(self._width_px, intrinsics.width_px), max(self._height_px, intrinsics.height_px)
        if (width_px, height_px) != (self._width_px, self._height_px):
            self._egl.resize(width_px, height_px)
            self._width_px, self._height_px = width_px, height_px

    def draw(
        self, intrinsics: Intrinsics, camera: Pose, segmentation: bool = True, transparent: Shapes = ()
    ) -> Drawing:
        """Draws the image of a camera.

        The colours' pass leaves transparent shapes out of the depth buffer, that of the segmentation does not, and what
        it leaves there can be read.
        """
        both = segmentation or bool(transparent)
        flags = 0 if both else self.pb.ER_NO_SEGMENTATION_MASK
        hardware = self.pb.ER_BULLET_HARDWARE_OPENGL
        drawing = _draw(self.pb, intrinsics, intrinsics.projection, camera, renderer=hardware, flags=flags)
        if transparent:
            drawing = drawing._replace(depth_buffer=self._egl.read_depth(intrinsics.width_px, intrinsics.height_px))
        return drawing


def open_renderer(cameras: Sequence[Camera], use_egl: bool = True) -> Renderer:
    """Returns the fastest renderer that works, with a client of its own."""
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
    """Renders a red wall that fills the view, and checks the image."""
    pb = renderer.pb
    shape = pb.createVisualShape(pb.GEOM_BOX, halfExtents=[1.0, 1.0, 0.1], rgbaColor=[1.0, 0.0, 0.0, 1.0])
    wall = pb.createMultiBody(0.0, -1, shape, [0.0, 0.0, distance_m + 0.1])
    intrinsics = Intrinsics(width_px=64, height_px=48, near_m=0.1, far_m=10.0)
    drawing = renderer.draw(intrinsics, Pose())
    pb.removeBody(wall)
    renderer.draw(intrinsics, Pose())  # else the wall's shadow is in the next image, the first that anybody sees
    red, green, blue = drawing.rgba[..., :3].reshape(-1, 3).mean(axis=0)
    problem: str | None = None
    if not (drawing.body_ids == wall).all():
        problem = "does not distinguish bodies"
    elif not red > 2 * max(green, blue):
        problem = "shows wrong colours"
    if problem:
        raise EglError(f"a test image {problem}")
