"""Formats Markdown for GitHub."""

import re
from collections.abc import Iterable, Sequence

WRITTEN_BY = "<!-- Written by `./rpbi docs` from the code: change it there, not here. -->"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Returns a table; cells may contain line breaks and `|`."""
    lines = [_row(head), "|" + "---|" * len(head)]
    return "\n".join([*lines, *map(_row, rows)])


def link(title: str, page: str = "", words: str = "") -> str:
    """Returns a link to a heading.

    Args:
        title: The heading.
        page: File of the page with the heading; empty if the link is on the same page.
        words: Text of the link; by default the heading.
    """
    anchor = re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")
    return f"[{words or title}]({page}#{anchor})"


def code(text: str) -> str:
    """Returns a text as inline code."""
    return f"`{text}`"


def block(language: str, text: str) -> str:
    """Returns a text as a code block."""
    return f"```{language}\n{text.strip()}\n```"


def page(parts: Iterable[str]) -> str:
    """Joins paragraphs, tables and headings to a page; leaves out empty parts."""
    return "\n\n".join(filter(None, parts)) + "\n"


def _row(cells: Sequence[str]) -> str:
    texts = (re.sub(r"(?<!\\)\|", r"\\|", " ".join(cell.split())) for cell in cells)
    return "| " + " | ".join(texts) + " |"
