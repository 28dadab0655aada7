"""Labels, legends and small images in pictures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib import colormaps
from PIL import Image, ImageDraw
from render import font
from sensor_msgs.msg import Image as ImageMessage

SIZE_PX, MARGIN_PX, BORDER_PX = 18, 6, 2
INK, PAPER = "#222222", "#ffffff"


def label(
    picture: Image.Image, text: str, at: tuple[float, float], points_to: tuple[float, float] | None = None
) -> None:
    """Writes text on white, with its middle at a pixel, and draws a line to what it names.

    Args:
        picture: The picture, which is changed.
        text: The text.
        at: Column and row of the middle of the text [px].
        points_to: Column and row of the line's end [px]; None draws no line.
    """
    draw = ImageDraw.Draw(picture)
    if points_to is not None:
        draw.line((*at, *points_to), INK, BORDER_PX)
    box = draw.textbbox(at, text, font=font(SIZE_PX), anchor="mm")
    left, top, right, bottom = (each + side * MARGIN_PX for each, side in zip(box, (-1, -1, 1, 1)))
    draw.rounded_rectangle((left, top, right, bottom), MARGIN_PX, PAPER, "#bbbbbb")
    draw.text(at, text, INK, font(SIZE_PX), anchor="mm")


def with_legend(picture: Image.Image, lines: Sequence[tuple[str, str]]) -> Image.Image:
    """Returns a picture with texts in a row below it, each after a sample of its colour.

    Args:
        picture: The picture.
        lines: Colours and texts.
    """
    height, sample = 2 * SIZE_PX, 2 * SIZE_PX
    whole = Image.new("RGB", (picture.width, picture.height + height), PAPER)
    whole.paste(picture)
    draw = ImageDraw.Draw(whole)
    left, middle = float(MARGIN_PX), picture.height + height // 2
    for colour, text in lines:
        draw.line((left, middle, left + sample, middle), colour, 5)
        draw.text((left + sample + MARGIN_PX, middle), text, INK, font(SIZE_PX), anchor="lm")
        left += sample + 5 * MARGIN_PX + draw.textlength(text, font(SIZE_PX))
    return whole


def inset(picture: Image.Image, small: Image.Image, text: str, at: tuple[int, int]) -> None:
    """Puts a small image with a border and a label into a picture.

    Args:
        picture: The picture, which is changed.
        small: The image in the size that it shall have.
        text: Its label.
        at: Column and row of its upper left corner [px].
    """
    left, top = at
    frame = (left - BORDER_PX, top - BORDER_PX, left + small.width + BORDER_PX - 1, top + small.height + BORDER_PX - 1)
    ImageDraw.Draw(picture).rectangle(frame, PAPER)
    picture.paste(small, at)
    half = ImageDraw.Draw(picture).textlength(text, font(SIZE_PX)) / 2
    label(picture, text, (left + half + 2 * MARGIN_PX, top + SIZE_PX))


def colour_image(message: ImageMessage) -> Image.Image:
    """Returns a camera's colour image, encoding `rgb8`."""
    return Image.frombytes("RGB", (message.width, message.height), bytes(message.data))


def depth_image(message: ImageMessage, near_m: float, far_m: float) -> Image.Image:
    """Returns a camera's depth image, encoding `32FC1`, in colours: near is yellow, far is violet, beyond is white."""
    metres = np.frombuffer(message.data, np.float32).reshape(message.height, message.width)
    shares = (metres - near_m) / (far_m - near_m)
    colours = colormaps["viridis_r"](np.clip(shares, 0.0, 1.0), bytes=True)[:, :, :3]
    colours[~(shares < 1.0)] = 255
    return Image.fromarray(colours)
