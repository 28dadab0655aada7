"""Pages that list names of others: functions of PyBullet, robots, authors."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pybullet
import pytest
import yaml

from robot_model.asset_files import find_file
from rpbi.world import World

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs/from_pybullet.md").read_text(encoding="utf-8")
ROWS = [line.split("|")[1:-1] for line in PAGE.splitlines() if line.startswith("| `")]
ROBOT_PAGE = (ROOT / "docs/example_robots.md").read_text(encoding="utf-8")
ROBOTS = re.findall(r"^\| [^|]+ \| `([^`]+\.urdf)` \| (\d+) \|", ROBOT_PAGE, re.MULTILINE)
EXAMPLES = re.findall(r"^\| `basic_example_(\w+)` \| [^|]+ \| ([^|]+) \|", ROBOT_PAGE, re.MULTILINE)


def moving_joints(file: str) -> list[ET.Element]:
    """Returns the joints of a URDF that can move."""
    tree = ET.parse(find_file(file, str(ROOT / "docs/example_robots.md"))).getroot()
    return [each for each in tree.findall("joint") if each.get("type") in ("revolute", "continuous", "prismatic")]


def test_functions_are_those_of_pybullet():
    functions = {name for row in ROWS for name in re.findall(r"`([a-z]\w+)`", row[0])}
    parameters = {"numSolverIterations", "contactERP"}
    assert len(functions) > 40
    assert [name for name in sorted(functions - parameters) if not hasattr(pybullet, name)] == []


def test_counterparts_exist():
    reference = (ROOT / "docs/topics_and_services.md").read_text(encoding="utf-8")
    names = set(re.findall(r"rpbi/[\w/]*\w", " ".join(row[2] for row in ROWS))) - {"rpbi/NAME/LINK", "rpbi/camera"}
    assert [name for name in sorted(names) if f"`{name}`" not in reference] == []
    methods = set(re.findall(r"world\.(\w+)", " ".join(row[3] for row in ROWS)))
    assert [name for name in sorted(methods) if not hasattr(World, name)] == []
    assert len(names) > 15 and len(methods) > 10


@pytest.mark.parametrize(("file", "joints"), ROBOTS)
def test_robots_have_the_stated_joints(file, joints):
    assert sum(each.find("mimic") is None for each in moving_joints(file)) == int(joints)


@pytest.mark.parametrize(("name", "joints"), EXAMPLES)
def test_robots_of_the_examples_have_the_stated_joints(name, joints):
    folder = ROOT / f"src/rpbi_examples/configs/basic_example_{name}"
    texts = [path.read_text(encoding="utf-8") for path in sorted(folder.glob("*.yaml"))]
    (file,) = {urdf for text in texts for urdf in re.findall(r"fileName: \"?([^\s\"]+\.urdf)", text)}
    robots = 2 if name.startswith("dual_") else 1
    assert robots * len(moving_joints(file)) == sum(map(int, re.findall(r"\d+", joints)))


def test_citation_names_all_authors():
    paper = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))["preferred-citation"]
    page = " ".join((ROOT / "docs/citing.md").read_text(encoding="utf-8").replace(r"{\~a}", "ã").split())
    listed = re.search(r"author += \{([^=]*)\},", page)
    assert listed is not None
    names = [f"{each['family-names']}, {each['given-names']}" for each in paper["authors"]]
    assert listed[1].split(" and ") == names
    assert paper["title"] in page.replace("{{", "").replace("}}", "").replace("{", "").replace("}", "")
