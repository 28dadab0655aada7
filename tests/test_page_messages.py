"""Messages on the pages are those of the code: most pairs of neighbouring words are in a string of the source."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator
from functools import cache

from page_blocks import ROOT, Block, all_blocks

LEVEL = re.compile(r"^\[(?:WARN|INFO|ERROR)\] (?:/\S+?(?: \([^)]*\))?: )?")
"""Begin of a logged line: level and topic."""
VALUES = re.compile(r"""'[^']*'|"[^"]*"|\S*[/_.]\w\S*|\d\S*(?: (?:mm|m|s|rad|deg|N)\b)?|[:,;()]""")
"""Parts of a message that the code fills in, and punctuation between messages."""
LEAST_SHARE = 2 / 3


def pairs_in(text: str) -> list[tuple[str, str]]:
    """Returns the pairs of neighbouring words of a text."""
    words = re.findall(r"[a-z]+", text.lower())
    return list(zip(words, words[1:]))


@cache
def pairs_of_source() -> set[tuple[str, str]]:
    """Returns the pairs of neighbouring words of all strings of the source."""
    trees = (ast.parse(path.read_text()) for path in ROOT.glob("src/*/src/**/*.py"))
    constants = (node.value for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Constant))
    texts = (part for value in constants if isinstance(value, str) for part in re.split(r"\{.*?\}|%\w", value))
    return {pair for text in texts for pair in pairs_in(text)}


def logged(blocks: Iterable[Block]) -> Iterator[tuple[Block, str]]:
    """Yields the logged lines of blocks, without level and topic."""
    for block in blocks:
        for line in block.text.splitlines() if block.language in ("text", "console") else ():
            if LEVEL.match(line) and "run by" not in block.marks:
                yield block, LEVEL.sub("", line)


def unknown_messages(blocks: Iterable[Block]) -> list[str]:
    """Returns the logged lines of which too many pairs of words are in no string of the source."""
    found = []
    for block, message in logged(blocks):
        pairs = [pair for part in VALUES.split(message) for pair in pairs_in(part)]
        known = [pair for pair in pairs if pair in pairs_of_source()]
        if len(known) < LEAST_SHARE * len(pairs):
            found.append(f"{block}: {message}")
    return found


def test_messages_on_pages_are_those_of_the_code():
    assert len(list(logged(all_blocks()))) > 20
    assert unknown_messages(all_blocks()) == []


def test_message_of_no_code_is_named():
    text = "[WARN] /a/b: the gripper forgot its colour: 3 mm\n[INFO] 'x': waypoints rejected"
    assert unknown_messages([Block("a.md", 1, "text", text)]) == ["a.md:1: the gripper forgot its colour: 3 mm"]
