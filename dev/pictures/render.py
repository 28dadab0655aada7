"""Pictures of simulated worlds, rendered without ROS and without windows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import font_manager
from PIL import Image, ImageDraw, ImageFont

from custom_ros_tools.plot_style import STYLE
from rpbi.images import looking_at
from rpbi.render.camera import Intrinsics, view_matrix
from rpbi.render.frame import Camera
from rpbi.render.mirror import Mirror
from rpbi.render.renderers import Renderer, open_renderer
from rpbi.world.load_log import LoadLogReader

if TYPE_CHECKING:
    from rpbi.world import World

SUPERSAMPLING = 2
NEAR_M, FAR_M = 0.05, 40.0
SKY = np.array((238, 242, 247), np.uint8)
"""Colour where nothing is."""


@dataclass(frozen=True)
class Tile(Intrinsics):
    """One of `SUPERSAMPLING` x `SUPERSAMPLING` parts of an image, since PyBullet draws at most 1024 x 768 pixels.

    Attributes:
        column: Column of the part, from the left.
        row: Row of the part, from the top.
    """

    column: int = 0
    row: int = 0

    @property
    def projection(self) -> np.ndarray:
        """The projection matrix of the whole image, with this part enlarged to the whole clip space."""
        matrix = super().projection
        last = SUPERSAMPLING - 1
        matrix[0] = SUPERSAMPLING * matrix[0] + (last - 2 * self.column) * matrix[3]
        matrix[1] = SUPERSAMPLING * matrix[1] - (last - 2 * self.row) * matrix[3]
        return matrix


class Photographer:
    """A pinhole camera that renders a world at its present tick, in a copy of the world, by OpenGL if possible.

    Args:
        position: Position of the camera, in the world's frame [m].
        target: Point in the centre of the picture, in the world's frame [m].
        fov_deg: Vertical field of view [deg].
        size: Columns and rows of the picture [px].
    """

    def __init__(
        self,
        position: Sequence[float],
        target: Sequence[float],
        fov_deg: float = 40.0,
        size: tuple[int, int] = (640, 480),
    ) -> None:
        self.size, self._fov_deg = size, fov_deg
        self._pose, self._intrinsics = looking_at(position, target), Intrinsics(*size, fov_deg, NEAR_M, FAR_M)
        self._world: World | None = None

    def picture(self, world: World) -> Image.Image:
        """Returns a picture of the world."""
        if self._world is not world:
            self._open(world)
        for entry in self._unread.drain():
            self._mirror.apply(entry)
        self._mirror.show(body.state() for body in world.bodies.values())
        tiles = range(SUPERSAMPLING)
        colours = np.vstack([np.hstack([self._tile(column, row) for column in tiles]) for row in tiles])
        return Image.fromarray(colours).reduce(SUPERSAMPLING)

    def _tile(self, column: int, row: int) -> np.ndarray:
        """Returns one of `SUPERSAMPLING` x `SUPERSAMPLING` parts, which has the size of the picture."""
        tile = Tile(*self.size, self._fov_deg, NEAR_M, FAR_M, column, row)
        drawing = self._renderer.draw(tile, self._pose, True, self._mirror.transparent)
        return np.where(drawing.body_ids[:, :, None] >= 0, drawing.rgba[:, :, :3], SKY).astype(np.uint8)

    def pixel(self, point: Sequence[float]) -> tuple[float, float]:
        """Returns column and row of a point of the world's frame [m] in the picture [px]."""
        x, y, _, w = self._intrinsics.projection @ view_matrix(self._pose) @ (*point, 1.0)
        return float((x / w + 1.0) / 2.0 * self.size[0]), float((1.0 - y / w) / 2.0 * self.size[1])

    def _open(self, world: World) -> None:
        if self._world is not None:
            self._mirror.close()
            self._renderer.pb.disconnect()
        self._renderer: Renderer = open_renderer([Camera("photographer", "", self._intrinsics)])
        self._mirror, self._unread, self._world = Mirror(self._renderer.pb), LoadLogReader(world.log), world


def font(size_px: int, bold: bool = False) -> ImageFont.FreeTypeFont:
    """Returns the font of plots, for captions and labels."""
    properties = font_manager.FontProperties(family=STYLE["font.family"], weight="bold" if bold else "normal")
    return ImageFont.truetype(font_manager.findfont(properties), size_px)


def with_caption(picture: Image.Image, text: str, size_px: int = 18) -> Image.Image:
    """Returns a picture with a line of text below."""
    margin = size_px // 2
    whole = Image.new("RGB", (picture.width, picture.height + size_px + 2 * margin), "white")
    whole.paste(picture)
    ImageDraw.Draw(whole).text((margin, picture.height + margin), text, "black", font(size_px))
    return whole


def beside(*pictures: Image.Image, gap_px: int = 8) -> Image.Image:
    """Returns pictures of one height in a row."""
    width = sum(each.width for each in pictures) + gap_px * (len(pictures) - 1)
    row = Image.new("RGB", (width, max(each.height for each in pictures)), "white")
    left = 0
    for each in pictures:
        row.paste(each, (left, 0))
        left += each.width + gap_px
    return row
