"""Transparent shapes of a renderer's client."""

from collections import Counter
from typing import NamedTuple

from rpbi.engine.client import Client


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
