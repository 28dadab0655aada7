"""Every name of `names.yaml` is found here, or its reason is on the page for users of the release."""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import roslib.packages
import rospkg
import yaml

ROOT = Path(__file__).resolve().parents[2]
NAMES: dict[str, Any] = yaml.safe_load((ROOT / "tests/support/release/names.yaml").read_text())
PAGE = (ROOT / "docs/from_the_release.md").read_text()


@cache
def code() -> str:
    """Returns all code, launch files and configurations of the packages, and the pages on topics and the guard."""
    paths = [path for end in ("py", "launch", "xml", "yaml") for path in sorted((ROOT / "src").rglob(f"*.{end}"))]
    return "\n".join(
        path.read_text() for path in (*paths, ROOT / "docs/topics_and_services.md", ROOT / "docs/safety.md")
    )


@cache
def schemas() -> str:
    paths = [*sorted((ROOT / "src").glob("*/schema/*.json")), *sorted((ROOT / "src").rglob("legacy.py"))]
    return "\n".join(path.read_text() for path in paths)


PACKAGES = rospkg.RosPack()


def package(name: str) -> bool:
    return name in PACKAGES.list()


def node(name: str) -> bool:
    folder, _, file = name.partition("/")
    return package(folder) and bool(roslib.packages.find_node(folder, file, PACKAGES))


def in_package(name: str) -> bool:
    folder, _, file = name.partition("/")
    return package(folder) and Path(PACKAGES.get_path(folder), file).exists()


def topic_or_service(name: str) -> bool:
    """Tells whether code has a name, or its first and its last part: some names are put together.

    What stands for others may be a field of a format, or an argument.
    """
    pattern = re.sub(r"[A-Z]{4,}", r"[{$(]*[\\w .]+[)}]*", re.escape(name))
    if re.search(rf"(?<![\w/]){pattern}(?![\w/])", code()):
        return True
    first, *_, last = name.split("/")
    return word(first) and bool(re.search(rf"[/\"']{last}[/\"']", code()))


def word(name: str) -> bool:
    return bool(re.search(rf"(?<!\w){re.escape(name)}(?!\w)", code()))


def key(name: str) -> bool:
    return bool(re.search(rf"\b{name}\b", schemas()) or re.search(rf"^ +{name}: ", code(), re.MULTILINE))


def python(name: str) -> bool:
    module, attribute = name.split(":")
    try:
        return hasattr(importlib.import_module(module), attribute)
    except ModuleNotFoundError:
        return False


def of_packages(by_package: dict[str, list[str]], between: str = "", end: str = "") -> Iterator[str]:
    for folder, names in by_package.items():
        yield from (f"{folder}/{between}{name}{end if '.' not in name else ''}" for name in names)


KINDS = {
    "packages": (package, NAMES["packages"]),
    "nodes": (node, of_packages(NAMES["nodes"])),
    "launch_files": (in_package, of_packages(NAMES["launch_files"], "launch/", ".launch")),
    "files": (in_package, of_packages(NAMES["files"])),
    "types": (python, [f"{at.replace('/', '.')}:{name}" for at, names in NAMES["types"].items() for name in names]),
    "topics_and_services": (topic_or_service, NAMES["topics_and_services"]),
    "frames": (word, NAMES["frames"]),
    "parameters": (word, NAMES["parameters"]),
    "keys": (key, NAMES["keys"]),
    "python": (python, NAMES["python"]),
}


def explained(name: str) -> bool:
    """Tells whether the page names it: as it is, or without package, module or end of the file."""
    last = re.split("[/:]", name)[-1]
    return any(f"`{each}`" in PAGE for each in (name, last, last.removesuffix(".launch")))


def test_every_kind_of_the_list_is_looked_for():
    assert KINDS.keys() == NAMES.keys()


@pytest.mark.parametrize("kind", KINDS)
def test_each_name_of_the_release_exists_or_is_explained(kind):
    is_there, names = KINDS[kind]
    missing = [name for name in names if not is_there(name)]
    assert [name for name in missing if not explained(name)] == [], f"neither found nor explained; {missing=}"
