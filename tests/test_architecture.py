"""The shape of the workspace: who may import what, and that every plug-in is shown, explained and tested."""

from __future__ import annotations

import ast
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SRC = ROOT / "src"
MODULES = {
    "custom_ros_tools": "custom_ros_tools",
    "ros_pybullet_interface": "rpbi",
    "ik_ros": "ik_ros",
    "rpbi_utils": "rpbi_utils",
    "rpbi_examples": "rpbi_examples",
}
"""Python module of each package."""
ALLOWED = {
    "custom_ros_tools": set(),
    "ros_pybullet_interface": {"custom_ros_tools"},
    "ik_ros": {"custom_ros_tools", "ros_pybullet_interface"},
    "rpbi_utils": {"custom_ros_tools", "ros_pybullet_interface"},
    "rpbi_examples": {"custom_ros_tools", "ros_pybullet_interface", "ik_ros", "rpbi_utils"},
}
"""What each package may depend on."""
MIDDLEWARE = re.compile(r"^(rospy|tf2_ros|rosbag|rosgraph|roslib|genpy|\w+_msgs|\w+_srvs)$")
MESSAGES_OF_OURS = re.compile(r"^(ros_pybullet_interface|custom_ros_tools\.(srv|msg))$")
MAX_NODE_LINES = 10


def _python_files(package: str) -> list[Path]:
    return sorted((SRC / package / "src").rglob("*.py"))


def _imports(path: Path) -> set[str]:
    """Returns the full names of all modules that a file imports from outside its own package."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level and node.module:
            names.add(node.module)
    return names


def test_every_package_is_known_here():
    assert {path.parent.name for path in SRC.glob("*/package.xml")} == set(MODULES) == set(ALLOWED)


@pytest.mark.parametrize("package", MODULES)
def test_only_ros_folders_import_middleware(package):
    offenders = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in _python_files(package)
        if "ros" not in path.relative_to(SRC / package / "src").parts[1:-1]
        for name in _imports(path)
        if MIDDLEWARE.match(name.split(".")[0]) or MESSAGES_OF_OURS.match(name)
        if not _is_for_typing(path, name)
    ]
    assert offenders == []


def _is_for_typing(path: Path, name: str) -> bool:
    """Tells whether an import stands under TYPE_CHECKING only."""
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING":
            return any(getattr(inner, "module", None) == name for inner in node.body)
    return False


@pytest.mark.parametrize("package", MODULES)
def test_imports_between_packages_are_those_of_package_xml(package):
    package_of = {module: name for name, module in MODULES.items()} | {name: name for name in MODULES}
    imported = {
        package_of[name.split(".")[0]]
        for path in _python_files(package)
        for name in _imports(path)
        if name.split(".")[0] in package_of
    } - {package}
    tree = ElementTree.parse(SRC / package / "package.xml")
    declared = {node.text for node in tree.iter() if node.tag.endswith("depend")} & set(MODULES)
    assert imported <= ALLOWED[package]
    assert imported <= declared, "package.xml lacks a dependency"
    assert declared <= ALLOWED[package]


@pytest.mark.parametrize("package", MODULES)
def test_nodes_only_call_main(package):
    for path in (SRC / package / "nodes").glob("*"):
        if path.is_file():
            code = [line for line in path.read_text().splitlines() if line.strip()]
            assert len(code) <= MAX_NODE_LINES, path
            assert path.stat().st_mode & 0o111, f"{path} is not executable"


def test_only_the_world_and_its_parts_call_pybullet_from_the_simulator_node():
    """Rule 1: nothing in the ROS layer reaches into PyBullet, but the robot's description on request."""
    for path in (SRC / "ros_pybullet_interface/src/rpbi/ros").glob("*.py"):
        calls = re.findall(r"\bpb\.\w+", path.read_text())
        assert path.name == "robot_info.py" or calls == [], path


def _tables() -> dict[str, list[str]]:
    from rpbi.bodies import BODY_TYPES
    from rpbi.sensors import SENSOR_TYPES

    return {"body": list(BODY_TYPES), "sensor": list(SENSOR_TYPES)}


@pytest.mark.parametrize("family", ["body", "sensor"])
def test_every_plug_in_is_explained(family):
    text = (ROOT / "docs/concepts.md").read_text()
    for name in _tables()[family]:
        assert f"`{name}`" in text, f"docs/concepts.md does not tell of {family} '{name}'"


def test_every_body_type_is_shown_in_an_example_and_tested():
    from rpbi.bodies import BODY_TYPES

    worlds = "".join(path.read_text() for path in (SRC / "rpbi_examples/configs").rglob("*.yaml"))
    tests = "".join(path.read_text() for path in (ROOT / "tests").rglob("*.py"))
    for kind, body_type in BODY_TYPES.items():
        assert f"{body_type.section}:" in worlds, f"no example has a {kind} object"
        assert body_type.section in tests, f"no test has a {kind} object"
