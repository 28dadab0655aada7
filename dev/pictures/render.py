"""Pictures of simulated worlds, rendered without ROS and without windows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pybullet
from matplotlib import font_manager
from PIL import Image, ImageDraw, ImageFont

if TYPE_CHECKING:
    from rpbi.world import World

SUPERSAMPLING = 2
LIGHT = (1.0, -1.5, 3.0)
"""Direction towards the light, in the world's frame."""
NEAR_M, FAR_M = 0.05, 20.0


class Photographer:
    """A pinhole camera that renders a world at its present tick.

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
        self.size = size
        self._view = pybullet.computeViewMatrix(position, target, (0.0, 0.0, 1.0))
        self._lens = pybullet.computeProjectionMatrixFOV(fov_deg, size[0] / size[1], NEAR_M, FAR_M)

    def picture(self, world: World) -> Image.Image:
        """Returns a picture of the world."""
        pb = next(iter(world.bodies.values())).pb
        width, height = (SUPERSAMPLING * each for each in self.size)
        colours = pb.getCameraImage(
            width,
            height,
            self._view,
            self._lens,
            lightDirection=LIGHT,
            shadow=1,
            renderer=pybullet.ER_TINY_RENDERER,
        )[2]
        pixels = np.reshape(np.asarray(colours, dtype=np.uint8), (height, width, 4))
        return Image.fromarray(pixels[:, :, :3]).reduce(SUPERSAMPLING)

    def pixel(self, point: Sequence[float]) -> tuple[float, float]:
        """Returns column and row of a point of the world's frame [m] in the picture [px]."""
        view, lens = (np.reshape(each, (4, 4)).T for each in (self._view, self._lens))
        x, y, _, w = lens @ view @ (*point, 1.0)
        return float((x / w + 1.0) / 2.0 * self.size[0]), float((1.0 - y / w) / 2.0 * self.size[1])


def font(size_px: int, bold: bool = False) -> ImageFont.FreeTypeFont:
    """Returns the font of captions, which comes with matplotlib."""
    properties = font_manager.FontProperties(family="DejaVu Sans", weight="bold" if bold else "normal")
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
