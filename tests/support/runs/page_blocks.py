"""Fenced blocks of the pages: their language, their mark, and the commands in them.

A comment on the line before a block is its mark. Parts of a mark are separated by "; ":

- `not run: REASON`: no test runs the block.
- `run by FILE, ...`: the tests in these files run it.
- `in COMMAND`: the commands need the world that another command launches.
- `part of FILE`: an excerpt of that file.
- `shorter`: the test runs the commands with smaller numbers, such as one seed instead of a hundred.
- `output varies`: the numbers of the output differ from run to run; only its other characters are compared.
"""

from __future__ import annotations

import re
import shlex
import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[3]
PAGES = [ROOT / "README.md", *sorted(ROOT.glob("docs/*.md"))]
COMMANDS = ("shell", "console")
"""Languages of blocks with commands. In `console`, commands begin with `$ `, and other lines are their output."""
LANGUAGES = {"python", *COMMANDS, "text", "yaml", "xml", "json", "cmake", "bibtex"}
_BLOCK = re.compile(
    r"(?:^ *<!-- ([^\n]*) -->\n)?^( *)```([^\n`]*)\n(.*?)^\2```$",
    re.MULTILINE | re.DOTALL,
)


class Block(NamedTuple):
    """A fenced block.

    Attributes:
        page: File of the page, relative to the workspace.
        line: Number of the line in the page on which the text of the block begins.
        language: Word after the opening fence; empty without one.
        text: Lines of the block, without their common indentation.
        mark: Comment on the line before the block; empty without one.
    """

    page: str
    line: int
    language: str
    text: str
    mark: str = ""

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"

    @property
    def marks(self) -> dict[str, str]:
        """Values of the parts of the mark, such as a reason or a file, indexed by kind."""
        parts = (
            re.fullmatch(r"(not run|run by|part of|in|shorter|output varies)(?::? (.+))?", each) for each in self._parts
        )
        return {part[1]: part[2] or "" for part in parts if part}

    @property
    def unknown_marks(self) -> list[str]:
        """Parts of the mark whose kind is unknown."""
        return [each for each in self._parts if each.startswith(("run", "not", "part", "in ", "shorter", "output"))][
            len(self.marks) :
        ]

    @property
    def _parts(self) -> list[str]:
        return self.mark.split("; ") if self.mark else []

    @property
    def commands(self) -> list[tuple[str, str]]:
        """The commands and the output that the block shows after each of them."""
        if self.language == "shell":
            return [(line, "") for line in _joined(self.text.splitlines()) if not line.startswith("#")]
        steps: list[tuple[str, list[str]]] = []
        for line in self.text.splitlines():
            if line.startswith("$ "):
                steps.append((line.removeprefix("$ "), []))
            elif steps:
                steps[-1][1].append(line)
        return [(command, "\n".join(output)) for command, output in steps]


def blocks_in(text: str, page: str) -> list[Block]:
    """Returns the blocks of a page, in order."""
    found = []
    for match in _BLOCK.finditer(text):
        line = text.count("\n", 0, match.start(4)) + 1
        found.append(Block(page, line, match[3].strip(), textwrap.dedent(match[4]), match[1] or ""))
    return found


def all_blocks() -> list[Block]:
    """Returns the blocks of all pages."""
    return [block for page in PAGES for block in blocks_in(page.read_text(), str(page.relative_to(ROOT)))]


def blocks_of(page: str, language: str) -> list[Block]:
    """Returns the blocks of a page that have a language and no mark `not run`."""
    found = blocks_in((ROOT / page).read_text(), page)
    return [block for block in found if block.language == language and "not run" not in block.marks]


def words(command: str) -> list[str]:
    """Returns the words of a command, without comments, as a shell splits them."""
    return shlex.split(command, comments=True)


def simple_commands(command: str) -> Iterator[list[str]]:
    """Yields the words of each simple command of a command line, without settings of variables.

    The command after `./rpbi shell -c` is another one.
    """
    lexer = shlex.shlex(command, posix=True, punctuation_chars="|&;<>")
    lexer.whitespace_split, lexer.commenters = True, "#"
    current: list[str] = []
    for word in [*lexer, ";"]:
        if not re.fullmatch(r"[|&;]+", word):
            current.append(word)
            continue
        while current and (re.match(r"[A-Z_]+=", current[0]) or current[0] in ("nice", "exec", "sudo", "source")):
            current = current[1:]
        if current:
            yield current
        if current[1:3] == ["shell", "-c"] and len(current) > 3:
            yield from simple_commands(current[3])
        current = []


def _joined(lines: Sequence[str]) -> Iterator[str]:
    """Yields the lines; those that a backslash or an open quotation mark joins are one."""
    current = ""
    for line in lines:
        current = f"{current}\n{line}" if current else line
        if current.endswith("\\"):
            continue
        try:
            shlex.split(current, comments=True)
        except ValueError:
            continue
        if current.strip():
            yield current
        current = ""
    if current:
        yield current
