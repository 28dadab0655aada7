"""Messages and services have the md5 sums that clients written for the authors' release expect."""

import importlib
import re
from pathlib import Path

import pytest
from release_types import CONTROL_MSGS, MESSAGES, SERVICES

SOURCES = Path(__file__).resolve().parents[3] / "src"


def md5_of(name: str, kind: str) -> str:
    """The md5 sum of the Python class that the build generated, e.g. of ("std_msgs/Bool", "msg")."""
    package, type_name = name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), type_name)._md5sum


@pytest.mark.parametrize("name, md5", (MESSAGES | CONTROL_MSGS).items(), ids=lambda value: value.split("/")[-1])
def test_message_is_compatible_on_the_wire(name: str, md5: str) -> None:
    assert md5_of(name, "msg") == md5


@pytest.mark.parametrize("name, md5", SERVICES.items(), ids=lambda value: value.split("/")[-1])
def test_service_is_compatible_on_the_wire(name: str, md5: str) -> None:
    assert md5_of(name, "srv") == md5


@pytest.mark.parametrize("path", sorted(SOURCES.glob("**/*.[ms][sr][gv]")), ids=lambda path: path.name)
def test_every_field_has_a_comment_in_its_definition(path: Path) -> None:
    """The definitions are what `rosmsg show -r` prints: each field has a comment, the file a first line.

    A key's constant says by its name which key it is.
    """
    lines = path.read_text().splitlines()
    fields = [line for line in lines if re.match(r"[A-Za-z]", line)]
    clear = "std_msgs/Header header", "uint16 KEY_", "uint16 MODIFIER_"
    silent = [line for line in fields if "#" not in line and not line.startswith(clear)]
    assert lines[0].startswith("# ")
    assert not silent
