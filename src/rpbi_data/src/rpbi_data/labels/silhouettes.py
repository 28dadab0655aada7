"""Draws silhouettes of objects, each as if the world contained no other object."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from robot_model.geometry import Pose
from rpbi.render.camera import Array, Intrinsics
from rpbi.render.mirror import Mirror
from rpbi.render.renderers import TinyRenderer
from rpbi.samples import BodyState
from rpbi.world import World
from rpbi.world.load_log import LoadLogReader

from .models import ObjectModel

MARGIN_PX = 2
"""Width of the border of a window around the object that is drawn in the window [px]."""

Mask = npt.NDArray[np.bool_]
Bounds = tuple[int, int, int, int]
"""First and last column, first and last row [px]."""
NOWHERE: Bounds = (0, -1, 0, -1)


@dataclass(frozen=True)
class ImageWindow(Intrinsics):
    """Camera intrinsics of a rectangular window of an image. The window may extend beyond the image.

    Attributes:
        left_px: Column of the image at which the window begins; may be negative.
        top_px: Row of the image at which the window begins; may be negative.
        whole: Intrinsics of the image.
    """

    left_px: int = 0
    top_px: int = 0
    whole: Intrinsics = Intrinsics()

    @classmethod
    def of(cls, whole: Intrinsics, left: int, top: int, right: int, bottom: int) -> ImageWindow:
        """Returns the window of the columns from `left` to `right - 1` and the rows from `top` to `bottom - 1`."""
        given = {field.name: getattr(whole, field.name) for field in fields(Intrinsics)}
        size = {"width_px": right - left, "height_px": bottom - top}
        return cls(**{**given, **size}, left_px=left, top_px=top, whole=whole)

    @property
    def projection(self) -> Array:
        """The image's projection matrix, shape (4, 4), scaled and shifted so that the window fills clip space."""
        matrix, K = self.whole.projection, self.whole.K
        matrix[0, 0] *= self.whole.width_px / self.width_px
        matrix[1, 1] *= self.whole.height_px / self.height_px
        matrix[0, 2] = 1.0 - 2.0 * (K[0, 2] - self.left_px + 0.5) / self.width_px
        matrix[1, 2] = 2.0 * (K[1, 2] - self.top_px + 0.5) / self.height_px - 1.0
        return matrix


class Silhouette(NamedTuple):
    """The pixels that an object would cover if the world contained no other object.

    Attributes:
        mask: Mask of the pixels within the image, shape (height, width).
        pixels: Number of covered pixels, including pixels outside the image.
        box: Bounds of the covered pixels, including pixels outside the image.
    """

    mask: Mask
    pixels: int
    box: Bounds

    def including(self, visible: Mask) -> Silhouette:
        """Returns this silhouette, extended to all pixels in which the object is visible.

        The extension is needed because rounding may make the edges of two drawings of an object differ.
        """
        missing = visible & ~self.mask
        if not missing.any():
            return self
        mask = self.mask | visible
        (left, right, top, bottom), seen = self.box, bounds(visible)
        if self.pixels:
            seen = min(left, seen[0]), max(right, seen[1]), min(top, seen[2]), max(bottom, seen[3])
        return Silhouette(mask, self.pixels + int(missing.sum()), seen)


class Silhouettes:
    """Draws one object at a time, with a separate PyBullet client for each model.

    Args:
        world: World of the objects.
        models: Models of the objects, indexed by object name.
    """

    def __init__(self, world: World, models: Mapping[str, ObjectModel]) -> None:
        entries = list(LoadLogReader(world.log).drain())
        first = {model.name for model in models.values()}
        self._drawn: dict[str, tuple[TinyRenderer, Mirror]] = {}
        for name in first:
            renderer = TinyRenderer()
            mirror = Mirror(renderer.pb)
            for entry in entries:
                if entry.what == "world" or entry.name == name:
                    mirror.apply(entry)
            self._drawn[name] = renderer, mirror

    def draw(self, model: ObjectModel, state: BodyState, T: Array, camera: Pose, whole: Intrinsics) -> Silhouette:
        """Draws an object alone, and returns its silhouette.

        Args:
            model: Model of the object.
            state: State of the object.
            T: Pose of the object's base link in the camera's optical frame, shape (4, 4) [m].
            camera: Pose of the camera's optical frame in the world.
            whole: Intrinsics of the image.
        """
        mask = np.zeros((whole.height_px, whole.width_px), bool)
        window = _window(model.points @ T[:3, :3].T + T[:3, 3], whole)
        if window is None:
            return Silhouette(mask, 0, NOWHERE)
        renderer, mirror = self._drawn[model.name]
        mirror.show([state._replace(name=model.name)])
        drawn = renderer.draw(window, camera, True, mirror.transparent).body_ids >= 0
        left, top = window.left_px, window.top_px
        rows, columns = (max(size - begin, 0) for size, begin in ((whole.height_px, top), (whole.width_px, left)))
        inside = drawn[max(-top, 0) : rows, max(-left, 0) : columns]
        mask[max(top, 0) :, max(left, 0) :][: inside.shape[0], : inside.shape[1]] = inside
        if not drawn.any():
            return Silhouette(mask, 0, NOWHERE)
        first, last, upper, lower = bounds(drawn)
        return Silhouette(mask, int(drawn.sum()), (left + first, left + last, top + upper, top + lower))

    def close(self) -> None:
        """Disconnects from PyBullet and deletes temporary files."""
        for renderer, mirror in self._drawn.values():
            mirror.close()
            renderer.pb.disconnect()


def bounds(mask: Mask) -> Bounds:
    """Returns the bounds of the true pixels in a mask, which must have at least one true pixel."""
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    return int(columns[0]), int(columns[-1]), int(rows[0]), int(rows[-1])


def _window(points: Array, whole: Intrinsics) -> ImageWindow | None:
    """Returns the window that contains the projections of points, or None if the window is empty.

    On each side, the window extends beyond the image by at most the size of the image. The points are in the optical
    frame, shape (n, 3) [m].
    """
    width, height = whole.width_px, whole.height_px
    if points[:, 2].min() < whole.near_m:  # the object extends behind the camera
        return ImageWindow.of(whole, -width, -height, 2 * width, 2 * height)
    u, v, _ = whole.K @ (points / points[:, 2:]).T
    left, right = _clipped(u, width)
    top, bottom = _clipped(v, height)
    return ImageWindow.of(whole, left, top, right, bottom) if left < right and top < bottom else None


def _clipped(pixels: Array, size: int) -> tuple[int, int]:
    low, high = np.floor(pixels.min()) - MARGIN_PX, np.ceil(pixels.max()) + MARGIN_PX + 1
    return int(max(low, -size)), int(min(high, 2 * size))
