"""Diagrams as SVG: boxes, arrows and labels on a light card, whose text stays text."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import NamedTuple

Point = tuple[float, float]
SIMULATOR, PEOPLE, GUARD, DATA, PLAIN = "#dbeafe", "#ffedd5", "#dcfce7", "#ede9fe", "#f3f4f6"
"""Fills of boxes."""
INK, GREY, CARD = "#1f2937", "#4b5563", "#ffffff"
LINE_PX, TITLE_PX = 19, 20
"""Heights of a line of text, and of a title."""
STYLE = f"""
text {{ font-family: Helvetica, Arial, "DejaVu Sans", sans-serif; font-size: 14px; fill: {INK}; }}
.title {{ font-weight: bold; font-size: 15px; }}
.label {{ font-size: 13px; fill: {GREY}; paint-order: stroke; stroke: {CARD}; stroke-width: 4px; }}
.code {{ font-family: "DejaVu Sans Mono", Menlo, Consolas, monospace; font-size: 12.5px; }}
.box {{ stroke: {GREY}; stroke-width: 1; }}
.arrow {{ stroke: {GREY}; stroke-width: 1.6; fill: none; marker-end: url(#head); }}
"""
HEAD = (
    '<defs><marker id="head" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="8" markerHeight="8" '
    f'orient="auto-start-reverse"><path d="M 0 1 L 10 5 L 0 9 z" fill="{GREY}"/></marker></defs>'
)


class Box(NamedTuple):
    """A box of a diagram: left, top, width and height [px]."""

    x: float
    y: float
    width: float
    height: float

    def left(self, share: float = 0.5) -> Point:
        """Returns a point of the left edge; `share` runs from 0 at the top to 1 at the bottom."""
        return self.x, self.y + share * self.height

    def right(self, share: float = 0.5) -> Point:
        """Returns a point of the right edge; `share` runs from 0 at the top to 1 at the bottom."""
        return self.x + self.width, self.y + share * self.height

    def top(self, share: float = 0.5) -> Point:
        """Returns a point of the top edge; `share` runs from 0 at the left to 1 at the right."""
        return self.x + share * self.width, self.y

    def bottom(self, share: float = 0.5) -> Point:
        """Returns a point of the bottom edge; `share` runs from 0 at the left to 1 at the right."""
        return self.x + share * self.width, self.y + self.height


class Diagram:
    """A diagram that is readable on light and dark pages, since it has a background of its own.

    Args:
        width: Width [px].
        height: Height [px].
        title: Text for readers who do not see the diagram.
    """

    def __init__(self, width: float, height: float, title: str) -> None:
        self._parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}" '
            f'height="{height:g}" role="img">',
            f"<title>{escape(title)}</title><style>{STYLE}</style>{HEAD}",
            f'<rect x="0.5" y="0.5" width="{width - 1:g}" height="{height - 1:g}" rx="10" fill="{CARD}" '
            f'stroke="#d1d5db"/>',
        ]

    def box(self, box: Box, fill: str, title: str, lines: Sequence[str] = (), centred: bool = True) -> Box:
        """Draws a box with a title and lines of text, and returns the box. A line that starts with `$` is code."""
        x, y, width, height = box
        self._parts.append(
            f'<rect class="box" x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" rx="6" fill="{fill}"/>'
        )
        left, anchor = (x + width / 2.0, "middle") if centred else (x + 12.0, "start")
        top = y + 24.0 if not centred else y + (height - TITLE_PX - LINE_PX * len(lines)) / 2.0 + 16.0
        self.text((left, top), title, "title", anchor)
        for number, line in enumerate(lines, 1):
            style = "code" if line.startswith("$") else ""
            self.text((left, top + LINE_PX * number), line.removeprefix("$"), style, anchor)
        return box

    def text(self, at: Point, text: str, style: str = "label", anchor: str = "middle") -> None:
        """Writes a line of text; `at` is on its baseline [px]."""
        self._parts.append(
            f'<text x="{at[0]:g}" y="{at[1]:g}" class="{style}" text-anchor="{anchor}">{escape(text)}</text>'
        )

    def arrow(self, *points: Point, dashed: bool = False, both: bool = False) -> None:
        """Draws an arrow along points [px]; `both` gives it two heads."""
        path = " L ".join(f"{x:g} {y:g}" for x, y in points)
        more = ' stroke-dasharray="5 4"' * dashed + ' marker-start="url(#head)"' * both
        self._parts.append(f'<path class="arrow" d="M {path}"{more}/>')

    def write(self, path: Path) -> None:
        """Writes the file."""
        path.write_text("\n".join([*self._parts, "</svg>", ""]), encoding="utf-8")
