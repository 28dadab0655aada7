"""Every `rosservice call` and `rostopic pub` of the docs has arguments that its type takes."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

import genpy
import pytest
import roslib.message
import yaml

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([*ROOT.glob("docs/*.md"), ROOT / "README.md"])
COMMAND = re.compile(r"(?:^|`)\s*(?:\$ )?((?:rosservice call|rostopic pub) .*)", re.MULTILINE)
MOST_LINES = 5


def commands(text: str) -> Iterator[list[str]]:
    """Yields the words of each command of a page, as a shell splits them."""
    for match in COMMAND.finditer(text):
        lines = text[match.start(1) :].split("\n")
        for count in range(1, MOST_LINES + 1):
            try:
                yield shlex.split(re.sub(r"`.*", "", "\n".join(lines[:count])), comments=True)
                break
            except ValueError:  # a quotation that goes on in the next line
                continue


def service_types(text: str) -> dict[str, set[str]]:
    """Returns the types of services in the tables of pages, by the last part of the service's name."""
    types: dict[str, set[str]] = {}
    for row in re.findall(r"^\|.*\|$", text, re.MULTILINE):
        for kind in re.findall(r"\b([a-z]\w+/[A-Z]\w+)\b", row):
            if roslib.message.get_service_class(kind) is not None:
                for name in re.findall(r"`[~\w/]*?(\w+)`", row):
                    types.setdefault(name, set()).add(kind)
    return types


def filled(message: genpy.Message, arguments: list[str]) -> bool:
    """Whether the arguments, in YAML, fit a message or a request, as rosservice and rostopic read them."""
    values = [yaml.safe_load(argument) for argument in arguments]
    try:
        genpy.message.fill_message_args(message, values, keys={"now": genpy.Time(), "auto": None})
        message.serialize(BytesIO())
    except (genpy.MessageException, genpy.SerializationError):
        return False
    return True


def wrong_commands(text: str, types: dict[str, set[str]]) -> list[str]:
    """Returns the commands of a text whose arguments do not fit."""
    wrong = []
    for words in commands(text):
        positional = [word for word in words[2:] if word == "-r" or not re.fullmatch(r"-[^\d].*|-1", word)]
        if "-r" in positional:
            del positional[positional.index("-r") : positional.index("-r") + 2]
        name, *arguments = positional
        if words[0] == "rostopic":
            kind, *arguments = arguments
            fits = filled(roslib.message.get_message_class(kind)(), arguments)
        else:
            known = types.get(name.rpartition("/")[2], set())
            fits = not arguments or any(
                filled(roslib.message.get_service_class(kind)._request_class(), arguments) for kind in known
            )
        if not fits:
            wrong.append(" ".join(words))
    return wrong


@pytest.fixture(scope="module")
def types() -> dict[str, set[str]]:
    return service_types("\n".join(page.read_text() for page in PAGES))


def test_commands_of_the_docs_fit_their_types(types):
    texts = [page.read_text() for page in PAGES]
    assert sum(len(list(commands(text))) for text in texts) > 40
    assert [each for text in texts for each in wrong_commands(text, types)] == []


def test_wrong_commands_are_found(types):
    text = "\n".join(
        [
            "rosservice call /rpbi/arm/press/set_gains '{force: 5}'",
            "rostopic pub -r 10 /target sensor_msgs/JointState '{names: [a]}'",
            "rosservice call /mvn/record true  # a comment",
        ]
    )
    assert [each.split()[0] for each in wrong_commands(text, types)] == ["rosservice", "rostopic"]
