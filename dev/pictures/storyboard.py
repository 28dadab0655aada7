"""Frames of a moving picture in steps: a bar with the steps, one or more pictures, and a caption."""

from __future__ import annotations

from collections.abc import Sequence

from PIL import Image, ImageDraw
from render import font

WIDTH, BAR, CAPTION, GAP = 800, 40, 62, 6
"""Width of frames, heights of the bar and of the caption, and gap between pictures [px]."""
INK, PALE, BLUE, GREEN = "#1f2937", "#9ca3af", "#1d4ed8", "#15803d"


def frame(steps: Sequence[str], step: int, picture: Image.Image, caption: str, result: str = "") -> Image.Image:
    """Returns a frame.

    Args:
        steps: Names of all steps.
        step: Index of the step that is shown.
        picture: Picture of the step, with `WIDTH` columns.
        caption: Line of text below the picture.
        result: Second line of text, which is emphasized.
    """
    whole = Image.new("RGB", (WIDTH, BAR + picture.height + CAPTION), "white")
    whole.paste(picture, (0, BAR))
    draw = ImageDraw.Draw(whole)
    width = WIDTH / len(steps)
    for number, name in enumerate(steps):
        left = number * width
        if number == step:
            draw.rectangle((left, 0, left + width, BAR - 1), BLUE)
        colour = "white" if number == step else INK if number < step else PALE
        draw.text((left + width / 2.0, BAR / 2.0), f"{number + 1}  {name}", colour, font(17, number == step), "mm")
    draw.text((12, BAR + picture.height + 20), caption, INK, font(16), "lm")
    draw.text((12, BAR + picture.height + 45), result, GREEN, font(16, bold=True), "lm")
    return whole


def titled(picture: Image.Image, title: str, border: str = "") -> Image.Image:
    """Returns a copy of a picture with a title in its lower left corner, and a border in the colour `border`."""
    copy = picture.copy()
    draw = ImageDraw.Draw(copy)
    if border:
        draw.rectangle((0, 0, copy.width - 1, copy.height - 1), outline=border, width=5)
    at = 14, copy.height - 30
    left, top, right, bottom = draw.textbbox(at, title, font(15, bold=True))
    draw.rectangle((left - 5, top - 4, right + 5, bottom + 4), border or "white")
    draw.text(at, title, "white" if border else INK, font(15, bold=True))
    return copy


def grid(pictures: Sequence[Image.Image], columns: int) -> Image.Image:
    """Returns pictures of one size row by row, `GAP` pixels apart."""
    width, height = pictures[0].size
    rows = -(-len(pictures) // columns)
    whole = Image.new("RGB", (columns * (width + GAP) - GAP, rows * (height + GAP) - GAP), "white")
    for number, picture in enumerate(pictures):
        whole.paste(picture, (number % columns * (width + GAP), number // columns * (height + GAP)))
    return whole
