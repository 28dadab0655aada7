"""Lines, arrows and words over a render."""

from __future__ import annotations

import math
from collections.abc import Sequence

from PIL import Image, ImageDraw
from render import Photographer, font

from robot_model.geometry import Vector

FINE = 4
"""Rows and columns of the overlay for each of the picture, so that lines have smooth edges."""
HEAD_PX = 16
"""Length of the head of an arrow [px]."""
BRIGHT = (255, 255, 255, 215)
"""Ground of words."""


class Overlay:
    """Draws over a render. Points are in the world's frame [m], widths and offsets in pixels of the picture.

    Args:
        camera: Camera that has taken the render.
        render: The render.
    """

    def __init__(self, camera: Photographer, render: Image.Image) -> None:
        self._camera, self._render = camera, render.convert("RGBA")
        self._layer = Image.new("RGBA", (FINE * render.width, FINE * render.height), (255, 255, 255, 0))
        self._draw = ImageDraw.Draw(self._layer)

    def line(self, points: Sequence[Vector], colour: str, width_px: float = 3.0) -> None:
        """Draws a line through points."""
        self._draw.line([self._fine(each) for each in points], colour, round(FINE * width_px), joint="curve")

    def dot(self, point: Vector, colour: str, radius_px: float = 5.0) -> None:
        """Draws a filled circle with a white edge."""
        x, y = self._fine(point)
        r = FINE * radius_px
        self._draw.ellipse((x - r, y - r, x + r, y + r), colour, "white", FINE)

    def arrow(self, start: Vector, end: Vector, colour: str, width_px: float = 6.0) -> None:
        """Draws an arrow from one point to another."""
        (x0, y0), (x1, y1) = self._fine(start), self._fine(end)
        angle, head = math.atan2(y1 - y0, x1 - x0), FINE * HEAD_PX
        cos, sin = math.cos(angle), math.sin(angle)
        neck = x1 - 0.8 * head * cos, y1 - 0.8 * head * sin
        self._draw.line([(x0, y0), neck], colour, round(FINE * width_px))
        sides = ((x1 - head * cos - s * head * sin, y1 - head * sin + s * head * cos) for s in (-0.5, 0.5))
        self._draw.polygon([(x1, y1), *sides], colour)

    def words(
        self, point: Vector, text: str, colour: str = "black", offset_px: tuple[float, float] = (10, -10)
    ) -> None:
        """Writes a text, whose left middle is at an offset from a point, on a bright ground."""
        x, y = (FINE * (at + off) for at, off in zip(self._camera.pixel(point), offset_px))
        letters = font(FINE * 16)
        left, top, right, bottom = self._draw.textbbox((x, y), text, font=letters, anchor="lm")
        edge = 4 * FINE
        self._draw.rounded_rectangle((left - edge, top - edge, right + edge, bottom + edge), 4 * FINE, BRIGHT)
        self._draw.text((x, y), text, colour, letters, anchor="lm")

    def pointer(self, point: Vector, text: str, offset_px: tuple[float, float]) -> None:
        """Writes a text at an offset from a point, with a line from the text to the point."""
        (x, y), (right, down) = self._fine(point), offset_px
        self._draw.line([(x, y), (x + FINE * right, y + FINE * down)], "black", round(FINE * 1.5))
        self.dot(point, "black", 4.0)
        self.words(point, text, offset_px=offset_px)

    def picture(self) -> Image.Image:
        """Returns the render with all that was drawn."""
        return Image.alpha_composite(self._render, self._layer.reduce(FINE)).convert("RGB")

    def _fine(self, point: Vector) -> tuple[float, float]:
        x, y = self._camera.pixel(point)
        return FINE * x, FINE * y
