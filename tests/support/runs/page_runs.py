"""Runs the Python blocks of a page one after the other in one process, and compares what they print with the page.

A comment behind a `print` is the output of this line if it begins with a digit, a capital letter, a bracket or a
quotation mark; else it is a remark. `...` stands for any text.
"""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from page_blocks import ROOT, Block, blocks_in

PYTHON = ROOT / ".venv/bin/python"
_SHOWN = re.compile(r"^\s*print\(.*\)\s+# ([\dA-Z\[('\"{].*)$")
_PROGRAM = """\
import builtins, json, sys
page, blocks, exclude = json.load(open("blocks.json"))
sys.modules.update(dict.fromkeys(exclude))
printed, current, names = [], 0, {"__name__": "__main__"}
def record(*values, sep=" ", end="\\n", **options):
    text = sep.join(map(str, values)) + end
    printed.append((current, sys._getframe(1).f_lineno, text))
    builtins.print(text, end="")
names["print"] = record
try:
    for current, (line, text) in enumerate(blocks):
        exec(compile("\\n" * (line - 1) + text, page, "exec"), names)
finally:
    json.dump(printed, open("printed.json", "w"))
"""


class Printed(NamedTuple):
    """A text that a block has printed.

    Attributes:
        block: Index of the block.
        line: Line of the page with the `print`.
        text: The text.
    """

    block: int
    line: int
    text: str


def run_blocks(blocks: Sequence[Block], folder: Path, python: Path = PYTHON, exclude: Iterable[str] = ()) -> list[str]:
    """Runs blocks in an environment that knows nothing of the workspace, and compares their output with the page.

    Args:
        blocks: Python blocks of one page.
        folder: Working folder. The YAML files of the page are written into it.
        python: Interpreter.
        exclude: Modules that the blocks cannot import.

    Returns:
        The text that each block has printed.

    Raises:
        AssertionError: If a block fails, or prints something else than the page shows.
    """
    page = blocks[0].page
    write_files(page, folder)
    data = [page, [(block.line, block.text) for block in blocks], list(exclude)]
    (folder / "blocks.json").write_text(json.dumps(data))
    clean = ["env", "-i", "PATH=/usr/local/bin:/usr/bin:/bin", f"HOME={folder}", str(python), "-c", _PROGRAM]
    done = subprocess.run(clean, cwd=folder, capture_output=True, text=True, timeout=300.0)
    assert done.returncode == 0, done.stderr
    printed = [Printed(*each) for each in json.loads((folder / "printed.json").read_text())]
    wrong = wrong_outputs(blocks, printed)
    assert not wrong, "\n".join(wrong)
    return ["".join(each.text for each in printed if each.block == index) for index in range(len(blocks))]


def write_files(page: str, folder: Path) -> None:
    """Writes the YAML blocks of a page whose first line is a comment with a file name."""
    for block in blocks_in((ROOT / page).read_text(), page):
        name = re.match(r"# (\w+\.yaml)$", block.text, re.MULTILINE)
        if block.language == "yaml" and name:
            (folder / name[1]).write_text(block.text)


def wrong_outputs(blocks: Iterable[Block], printed: Sequence[Printed]) -> list[str]:
    """Returns the places of the page that show another output than the blocks have printed, with both outputs."""
    wrong = []
    for block in blocks:
        for number, line in enumerate(block.text.splitlines(), block.line):
            if shown := _SHOWN.match(line):
                got = next((each.text for each in printed if each.line == number), "nothing")
                if not agree(shown[1], got, "output varies" in block.marks):
                    wrong.append(f"{block.page}:{number} shows {shown[1]!r}, prints {got.strip()!r}")
    return wrong


def agree(shown: str, printed: str, varies: bool = False) -> bool:
    """Whether an output is that of the page.

    Args:
        shown: The output on the page, in which `...` stands for any text.
        printed: The output of the run.
        varies: Whether numbers and columns may differ.
    """
    lines = ("\n".join(map(str.rstrip, each.strip().splitlines())) for each in (shown, printed))
    texts = [_shape(each) if varies else each for each in lines]
    pattern = ".*".join(re.escape(part) for part in texts[0].split("..."))
    return re.fullmatch(pattern, texts[1], re.DOTALL) is not None


def _shape(text: str) -> str:
    """Returns a text with 0 for each number, and a space for each run of spaces."""
    numbers = re.sub(r"-?\d(?:[\d.,]*\d)?(?:e[-+]?\d+)?", "0", text)
    return re.sub(r"[ \t]+", " ", numbers)
