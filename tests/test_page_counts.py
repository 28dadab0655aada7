"""Numbers in the pages that the code can count: joints, objects, scenes, solvers, extras and their sizes."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from importlib.metadata import Distribution, distributions
from pathlib import Path
from typing import NamedTuple

import pytest
import yaml
from page_blocks import ROOT

EXAMPLES = "src/rpbi_examples"
NUMBERS = "zero one two three four five six seven eight nine ten eleven twelve".split()
TOLERANCE = 0.15
"""Largest difference between the size of an extra and the page, relative to the size."""
ROUNDING_MB = 3.0


def joints(urdf: str) -> int:
    """Returns the number of joints of a URDF that move."""
    text = (ROOT / EXAMPLES / "robots" / urdf).read_text()
    return len(re.findall(r'<joint [^>]*type="(?:revolute|continuous|prismatic)"', text))


def entries(table: str, pattern: str = r'^        "\w+": "') -> int:
    """Returns the number of lines of a table of plug-ins."""
    return len(re.findall(pattern, (ROOT / table).read_text(), re.MULTILINE))


def dropped_objects() -> int:
    """Returns the number of objects that fall in the example `clutter`."""
    world = yaml.safe_load((ROOT / EXAMPLES / "configs/clutter/config.yaml").read_text())
    return len(world["dynamic_objects"]) + len(world["urdfs"])


def rows(page: str, heading: str) -> int:
    """Returns the number of rows of the first table below a heading."""
    table = re.search(r"(?:^\|.*\n)+", (ROOT / page).read_text().split(f"\n{heading}\n")[1], re.MULTILINE)
    return table[0].count("\n") - 2 if table else 0


class Count(NamedTuple):
    """A number in a file.

    Attributes:
        file: The file.
        pattern: Regular expression with one group, the number; words up to twelve count.
        true: Computes the number.
    """

    file: str
    pattern: str
    true: Callable[[], int]


HUMAN, NEXTAGE = (lambda: joints("human_model.urdf")), (lambda: joints("nextage.urdf"))
SCENES = f"{EXAMPLES}/src/rpbi_examples/scenes/__init__.py"
COUNTS = [
    *(
        Count(f"{EXAMPLES}/configs/basic_example_human_model/{name}.yaml", r"human model of (\w+) joints", HUMAN)
        for name in ("config", "human")
    ),
    Count("docs/robots.md", r"human model with (\w+) joints", HUMAN),
    Count("docs/robots.md", r"swings its (\w+) joints", NEXTAGE),
    Count(f"{EXAMPLES}/launch/basic_example_nextage.launch", r"swings its (\w+) joints", NEXTAGE),
    Count("src/safe_robot/launch/nextage.launch", r"with its (\w+) joints", NEXTAGE),
    Count("docs/examples.md", r"(\w+) objects fall", dropped_objects),
    Count("docs/example_clutter.md", r"(\w+) objects fall", dropped_objects),
    Count(f"{EXAMPLES}/configs/clutter/config.yaml", r"(\w+) objects of", dropped_objects),
    Count("docs/examples.md", r"the (\w+) scenes at work", lambda: entries(SCENES)),
    Count("docs/example_robots.md", r"the (\w+) scenes at work", lambda: entries(SCENES)),
    Count("docs/ik.md", r"\[(\w+) solvers\]", lambda: entries("src/ik_ros/src/ik_ros/solvers/__init__.py")),
    Count("docs/gym.md", r"the (\w+) tasks in the first table", lambda: rows("docs/gym.md", "## Tasks")),
    Count(
        "docs/architecture.md", r"## (\w+) ways of data", lambda: rows("docs/architecture.md", "## Five ways of data")
    ),
]


def wrong_counts(counts: Iterable[Count], root: Path = ROOT) -> list[str]:
    """Returns the numbers that are not the computed ones, with both."""
    wrong = []
    for count in counts:
        found = re.findall(count.pattern, (root / count.file).read_text())
        words = [each.lower() for each in found if each.isdigit() or each.lower() in NUMBERS]
        numbers = {NUMBERS.index(word) if word in NUMBERS else int(word) for word in words}
        if numbers != {count.true()}:
            wrong.append(f"{count.file}: expected {count.true()} for '{count.pattern}', got {sorted(numbers)}")
    return wrong


def test_numbers_of_the_pages_are_those_of_the_code():
    assert wrong_counts(COUNTS) == []


def test_wrong_number_is_named(tmp_path):
    (tmp_path / "a.md").write_text("three arms, 4 arms")
    assert wrong_counts([Count("a.md", r"(\w+) arms", lambda: 3)], tmp_path) == [
        r"a.md: expected 3 for '(\w+) arms', got [3, 4]"
    ]


EXTRAS = {path.stem: path for path in (ROOT / "requirements/extras").glob("*.txt")}
INSTALLATION = (ROOT / "docs/installation.md").read_text()
SIZES = {
    name: float(size) for name, size in re.findall(r"^\| `(\w+)` \|.*\| ([\d,.]+) \|$", INSTALLATION, re.MULTILINE)
}
"""Sizes of the extras on the page [MB]."""


def normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def packages_of(file: Path) -> list[str]:
    return re.findall(r"^\s*([\w.-]+)==", file.read_text(), re.MULTILINE)


def installed() -> dict[str, Distribution]:
    """Returns the packages of the virtual environment, indexed by their normal names."""
    folders = [str(path) for path in ROOT.glob(".venv/lib/python3*/site-packages")]
    return {normal(each.metadata["Name"]): each for each in distributions(path=folders)}


def size_mb(package: Distribution) -> float:
    """Returns the space that the files of a package take on the disk [MB]."""
    paths = (Path(str(file.locate())) for file in package.files or ())
    return sum(path.stat().st_blocks * 512 for path in paths if path.is_file()) / 1e6


def test_the_page_has_every_extra_wherever_it_names_all():
    assert set(SIZES) == set(EXTRAS)
    for file in ("docs/installation.md", "docs/contributing.md"):
        lists = [
            line.split()
            for line in re.findall(r"\./rpbi setup ((?:[a-z0-9]+ ){5,}[a-z0-9]+)", (ROOT / file).read_text())
        ]
        assert lists and all(set(names) == set(EXTRAS) for names in lists), file


@pytest.mark.parametrize("extra", EXTRAS)
def test_size_of_an_extra_is_that_of_its_packages(extra):
    packages, names = installed(), [normal(name) for name in packages_of(EXTRAS[extra])]
    if missing := set(names) - packages.keys():
        pytest.skip(f"not installed: {', '.join(sorted(missing))}")
    size = sum(size_mb(packages[name]) for name in names)
    assert SIZES[extra] == pytest.approx(size, rel=TOLERANCE, abs=ROUNDING_MB)


def test_no_other_file_states_the_size_of_an_extra():
    assert [name for name, path in EXTRAS.items() if re.search(r"\d [MG]B\b", path.read_text())] == []
