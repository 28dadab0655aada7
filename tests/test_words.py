"""Pages, docstrings and messages use none of the words in dev/words.yaml."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import yaml
from page_blocks import PAGES, ROOT

RULES = yaml.safe_load((ROOT / "dev/words.yaml").read_text())
WORDS = {re.compile(rf"(?<![\w'-])(?:{word})(?![\w'-])"): instead for word, instead in RULES["words"].items()}
OPENING = re.compile(rf"(?:^|[.:!?] )((?:{'|'.join(RULES['openings'])})\b[^.?!]*)[.!]", re.MULTILINE)
WRITTEN_BY_OTHERS = {"docs/results.md"}


class Text(NamedTuple):
    """A text that users read, without code.

    Attributes:
        place: File, and the line of a text in source code.
        text: The text; each run of spaces and line ends in a paragraph is one space.
    """

    place: str
    text: str


def prose(place: str, text: str) -> Text:
    """Returns a text without blocks, comments and code."""
    text = re.sub(r"```.*?```|<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r"`[^`]*`", "`", text)
    return Text(place, re.sub(r"(?<!\n)\s+(?!\n|[-*|#>] )", " ", text))


def texts_of_source() -> Iterator[Text]:
    """Yields the strings of the source that have spaces: docstrings, descriptions and messages."""
    for path in sorted(ROOT.glob("src/*/src/**/*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
                yield prose(f"{path.relative_to(ROOT)}:{node.lineno}", node.value)


def texts_of_pages() -> Iterator[Text]:
    """Yields the pages."""
    for path in PAGES:
        if (place := str(path.relative_to(ROOT))) not in WRITTEN_BY_OTHERS:
            yield prose(place, path.read_text())


def unwanted(texts: Iterable[Text]) -> list[str]:
    """Returns the unwanted words of texts, each with its place and words to use instead."""
    found = []
    for place, text in texts:
        for allowed in RULES["allowed"]:
            text = text.replace(allowed, "")
        for word, instead in WORDS.items():
            found += [f"{place}: '{each[0]}': {instead}" for each in word.finditer(text.lower())]
        found += [f"{place}: sentence that opens with '{each[1][:40]}'" for each in OPENING.finditer(text)]
    return found


def test_pages_use_no_unwanted_word():
    assert unwanted(texts_of_pages()) == []


def test_source_uses_no_unwanted_word():
    assert unwanted(texts_of_source()) == []


def test_unwanted_words_are_found_and_code_is_left_out():
    text = """\
It goes on. The programs `vanish`.
Whoever is told
of it may leave. Of these, two are left. What is left? What is left is used.

```text
so much
```
An ongoing task, beside a path.
"""
    assert [each.split(": ", 1)[1] for each in unwanted([prose("a.md", text)])] == [
        "'goes on': continue",
        "'is told': receives, is named",
        "'whoever': anyone who, the user",
        "'beside': next to; in addition to",
        "sentence that opens with 'Of these, two are left'",
        "sentence that opens with 'What is left is used'",
    ]


def test_every_allowed_text_is_in_use():
    texts = [text.text for text in (*texts_of_pages(), *texts_of_source())]
    assert [each for each in RULES["allowed"] if not any(each in text for text in texts)] == []
