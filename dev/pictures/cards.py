"""Small pictures for the cards of the home page: parts of larger pictures, without their labels."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from files import write_png
from PIL import Image

IMAGES = Path(__file__).resolve().parents[2] / "docs/images"
SIZE = (480, 290)
"""Columns and rows of a card's picture [px]."""


class Part(NamedTuple):
    """Part of a picture, in the proportions of `SIZE`.

    Attributes:
        file: Name of the picture's file.
        middle: Middle of the part, in shares of the picture's width and height from its top left.
        width: Share of the picture's width.
        height: Share of the picture's height, between which and the card's height there is white; None for the card's
            proportions.
        frame: Number of the frame, if the picture moves.
    """

    file: str
    middle: tuple[float, float]
    width: float
    height: float | None = None
    frame: int = 0


PARTS = {
    "card_tutorial.png": Part("tutorial_rviz.png", (0.52, 0.44), 0.74),
    "card_guard.png": Part("guard_rviz.png", (0.45, 0.38), 0.8),
    "card_people.png": Part("avatar_walking.png", (0.76, 0.33), 0.46),
    "card_planning.png": Part("planning.png", (0.51, 0.41), 0.4),
    "card_data.png": Part("clutter_labels.png", (0.36, 0.5), 0.66),
    "card_learning.png": Part("scene_cup.gif", (0.6, 0.3), 0.78, frame=48),
    "card_reality.png": Part("reality_tosses.png", (0.255, 0.155), 0.37, 0.235),
    "card_viewers.png": Part("browser.png", (0.5, 0.36), 1.0),
}
"""The parts, indexed by the name of the card's picture."""


def draw(path: Path) -> None:
    """Draws the picture of a card, which is named by the file."""
    part = PARTS[path.name]
    with Image.open(IMAGES / part.file) as picture:
        picture.seek(part.frame)
        width, (column, row) = part.width * picture.width, part.middle
        height = width * SIZE[1] / SIZE[0] if part.height is None else part.height * picture.height
        left = min(max(0.0, column * picture.width - width / 2), picture.width - width)
        top = min(max(0.0, row * picture.height - height / 2), picture.height - height)
        box = (left, top, left + width, top + height)
        rows = round(SIZE[0] * height / width)
        small = picture.convert("RGB").resize((SIZE[0], rows), Image.Resampling.LANCZOS, box)
    card = Image.new("RGB", SIZE, "white")
    card.paste(small, (0, (SIZE[1] - rows) // 2))
    write_png(path, card, dither=True)
