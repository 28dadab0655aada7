"""The two renderers of PyBullet: a fast one that uses OpenGL through EGL, and a software renderer that always works."""

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
    """A visual shape that is neither opaque nor invisible.

    Attributes:
        body_id: Id of the shape's body in the renderer's client.
        link_index: PyBullet's index of the shape's link, -1 for the base.
        shape_index: Index of the shape within the link.
        rgba: Colour and opacity, each from 0 to 1.
    """

    body_id: int
    link_index: int
    shape_index: int
    rgba: tuple[float, float, float, float]


class Transparency:
    """Lists the transparent shapes of the bodies in a client, while bodies are added and removed.

    For a new body that got the id of a removed body, PyBullet's EGL plugin first reports the shapes of the removed
    body, then the shapes of the new body. This class skips the shapes of the removed body.
    """

    def __init__(self, pb: Client) -> None:
        self._pb = pb
        self._stale = {0: len(pb.getVisualShapeData(0))}  # the renderer has drawn a test image
        self._shapes_of: dict[int, tuple[TransparentShape, ...]] = {}
        self.shapes: tuple[TransparentShape, ...] = ()
        """All transparent shapes."""

    def update(self, body_ids: set[int]) -> None:
        """Updates the list of transparent shapes; `body_ids` are the ids of all bodies that exist now."""
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
"""Bit position of the link in PyBullet's segmentation values, which are `body + ((link + 1) << 24)`."""


class Drawing(NamedTuple):
    """Images that PyBullet has drawn.

    Attributes:
        rgba: Colour and alpha from 0 to 255, shape (height, width, 4), uint8.
        depth_buffer: Depth, 0 at the near plane and 1 at the far plane, shape (height, width), float32.
        body_ids: Body ids in the renderer's client, -1 for background, shape (height, width), int32. Undefined if
            `draw` was called without `segmentation`.
    """

    rgba: npt.NDArray[np.uint8]
    depth_buffer: npt.NDArray[np.float32]
    body_ids: npt.NDArray[np.int32]


class Renderer(Protocol):
    """Draws the bodies of a PyBullet client.

    In the colour image, objects behind a transparent shape are visible through it. The depth and segmentation images
    show the transparent shape itself.

    Attributes:
        name: Name of the renderer, for logs and diagnostics.
        pb: The client, which is empty at first.
    """

    name: str
    pb: Client

    def make_room(self, intrinsics: Intrinsics) -> None:
        """Prepares to draw images for a new camera, which may need larger images than before."""

    def draw(
        self, intrinsics: Intrinsics, camera: Pose, segmentation: bool = True, transparent: Shapes = ()
    ) -> Drawing:
        """Draws the image of a camera.

        Args:
            intrinsics: Intrinsics of the camera.
            camera: Pose of the camera's optical frame in the world frame.
            segmentation: Whether to draw body ids.
            transparent: All transparent shapes in the client.
        """


class TinyRenderer:
    """PyBullet's software renderer.

    PyBullet samples each pixel at the pixel's upper left corner instead of the centre. In addition, PyBullet samples
    each row one pixel too low. The image would therefore be shifted half a pixel to the right and half a pixel up from
    the image that K describes. `draw` shifts the projection by the same amount in the opposite direction.
    """

    name = "TinyRenderer"

    def __init__(self) -> None:
        self.pb = Client()

    def make_room(self, intrinsics: Intrinsics) -> None:
        """Does nothing."""

    def draw(
        self, intrinsics: Intrinsics, camera: Pose, segmentation: bool = True, transparent: Shapes = ()
    ) -> Drawing:
        """Draws the image of a camera.

        The renderer draws transparent shapes as if they were opaque. This method therefore draws a second image without
        transparent shapes and blends both images. A transparent shape behind another transparent shape is not visible.
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
    """Draws off-screen with OpenGL: on the graphics card, or on all processor cores with Mesa's llvmpipe.

    Only the thread that created the object may call its methods.

    Args:
        cameras: The initial cameras, at least one; the largest image determines the size of the drawing surface.

    Raises:
        EglError: If EGL cannot be loaded or draws a wrong test image. Some failures of EGL end the process instead.
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
        """Enlarges the drawing surface, if it is too small for a camera.

        Raises:
            EglError: If EGL cannot create a surface of that size.
        """
        width_px, height_px = max(self._width_px, intrinsics.width_px), max(self._height_px, intrinsics.height_px)
        if (width_px, height_px) != (self._width_px, self._height_px):
            self._egl.resize(width_px, height_px)
            self._width_px, self._height_px = width_px, height_px

    def draw(
        self, intrinsics: Intrinsics, camera: Pose, segmentation: bool = True, transparent: Shapes = ()
    ) -> Drawing:
        """Draws the image of a camera.

        PyBullet's colour pass does not write transparent shapes to the depth buffer, but the segmentation pass does. If
        there are transparent shapes, this method therefore reads the depth after the segmentation pass.
        """
        both = segmentation or bool(transparent)
        flags = 0 if both else self.pb.ER_NO_SEGMENTATION_MASK
        hardware = self.pb.ER_BULLET_HARDWARE_OPENGL
        drawing = _draw(self.pb, intrinsics, intrinsics.projection, camera, renderer=hardware, flags=flags)
        if transparent:
            drawing = drawing._replace(depth_buffer=self._egl.read_depth(intrinsics.width_px, intrinsics.height_px))
        return drawing


def open_renderer(cameras: Sequence[Camera], use_egl: bool = True) -> Renderer:
    """Creates the fastest renderer that works on this machine, with its own PyBullet client.

    Args:
        cameras: The initial cameras; without cameras, the software renderer is used.
        use_egl: Whether to try EGL.
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
    """Draws a red wall that fills the view, and raises an EglError if the image is wrong."""
    pb = renderer.pb
    shape = pb.createVisualShape(pb.GEOM_BOX, halfExtents=[1.0, 1.0, 0.1], rgbaColor=[1.0, 0.0, 0.0, 1.0])
    wall = pb.createMultiBody(0.0, -1, shape, [0.0, 0.0, distance_m + 0.1])
    intrinsics = Intrinsics(width_px=64, height_px=48, near_m=0.1, far_m=10.0)
    drawing = renderer.draw(intrinsics, Pose())
    pb.removeBody(wall)
    renderer.draw(intrinsics, Pose())  # otherwise the next image would show the wall's shadow
    red, green, blue = drawing.rgba[..., :3].reshape(-1, 3).mean(axis=0)
    problem: str | None = None
    if not (drawing.body_ids == wall).all():
        problem = "does not distinguish bodies"
    elif not red > 2 * max(green, blue):
        problem = "shows wrong colours"
    if problem:
        raise EglError(f"a test image {problem}")
