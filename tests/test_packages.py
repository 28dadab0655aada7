"""What the packages' package.xml files declare is what the packages use, and is to be had."""

from __future__ import annotations

import ast
import importlib.util
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
import rospkg
from clean_shell import in_clean_shell

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = sorted(path.parent for folder in ("src", "docs/templates") for path in ROOT.glob(f"{folder}/**/package.xml"))
OF_ROS = re.compile(r"ros(?!pkg)[a-z_]*|tf2?(_\w+)?|gen(py|msg)|actionlib|interactive_markers|\w+_(msgs|srvs)")
"""Python modules of ROS packages, which Debian ships without package.xml in part."""
NOT_IN_DEBIAN = {
    "depth_image_proc", "nodelet",  # optional: off unless the user asks
    "rosbags",  # of the extra data
}  # fmt: skip

REPLACEABLE = {
    "dmp": {"motion_primitives"},
    "ik_ros_examples": {"rpbi_examples"},
    "keyboard": {"operator_node"},
    "teleop": {"operator_node"},
}
"""Packages that stand-ins use undeclared: those of a workspace over this one, of the same names, need the stand-ins."""
RELEASE = {"operator_node": "keyboard teleop", "rpbi_examples": "ik_ros_examples"}
"""Packages of the release that are built over ours, with the packages of ours that they are built with."""


def _declared(package: Path) -> set[str]:
    tree = ElementTree.parse(package / "package.xml")
    return {str(node.text) for node in tree.iter() if node.tag.endswith("depend")}


def _imported(package: Path) -> set[str]:
    names: set[str] = set()
    for path in (package / "src").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                names |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                names.add(node.module.split(".")[0])
    return names


def _launched(package: Path) -> set[str]:
    text = "".join(path.read_text() for path in package.glob("launch/**/*.launch"))
    return set(re.findall(r'(?:\bpkg="|\$\(find )(\w+)', text))


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.name)
def test_every_ros_package_that_is_used_is_declared(package: Path) -> None:
    known = set(rospkg.RosPack().list())
    imported = {name for name in _imported(package) if name in known or OF_ROS.fullmatch(name)}
    used = imported | _launched(package)
    undeclared = {package.name} | NOT_IN_DEBIAN | REPLACEABLE.get(package.name, set())
    assert used - _declared(package) - undeclared == set()


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.name)
def test_every_dependency_is_a_ros_package_or_one_of_debian(package: Path) -> None:
    """The keys of rosdep for Debian's Python packages are the packages' own names."""
    others = _declared(package) - set(rospkg.RosPack().list())
    others = {name for name in others if not (OF_ROS.fullmatch(name) and importlib.util.find_spec(name))}
    answer = subprocess.run(["dpkg-query", "-W", *others], capture_output=True, text=True)
    assert answer.returncode == 0, answer.stderr


def test_packages_agree_on_who_maintains_them_and_under_which_licence() -> None:
    def facts(package: Path) -> tuple[str | None, ...]:
        tree = ElementTree.parse(package / "package.xml")
        return (tree.findtext("maintainer"), tree.findtext("license"), tree.findtext("version"))

    own = {facts(package) for package in PACKAGES if package.is_relative_to(ROOT / "src")}
    assert {(name, licence) for name, licence, _ in own} == {("ROS-PyBullet Interface developers", "LGPL-3.0-or-later")}
    assert len(own) == 1


@pytest.mark.thorough
@pytest.mark.parametrize("tool", ["catkin_make", "catkin_make_isolated"])
def test_packages_of_the_release_are_built_over_ours(tool: str, tmp_path: Path) -> None:
    for name, needed in RELEASE.items():
        package = tmp_path / "src" / name
        package.mkdir(parents=True)
        depends = "".join(f"<depend>{other}</depend>" for other in needed.split())
        (package / "package.xml").write_text(
            f"""<package format="2"><name>{name}</name><version>0.0.0</version><description>Its name.</description>
            <maintainer email="nobody@example.org">Nobody</maintainer><license>BSD</license>
            <buildtool_depend>catkin</buildtool_depend>{depends}</package>"""
        )
        (package / "CMakeLists.txt").write_text(
            f"""cmake_minimum_required(VERSION 3.16)
            project({name} C)
            find_package(catkin REQUIRED COMPONENTS {needed})
            catkin_package()"""
        )
    build = f"cd {tmp_path}; {tool} --no-color -DPYTHON_EXECUTABLE=/usr/bin/python3 -DCATKIN_ENABLE_TESTING=OFF"
    setup = f"{'devel' if tool == 'catkin_make' else 'devel_isolated'}/setup.bash"
    line = f"{build}; source {setup}; rospack find rpbi_examples; rospack find ik_ros_examples"
    done = subprocess.run(in_clean_shell(line, ROOT / "devel/setup.bash"), capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    found = [Path(line).resolve() for line in done.stdout.splitlines()[-2:]]
    assert found == [tmp_path / "src/rpbi_examples", ROOT / "src/compatibility/ik_ros_examples"]


def test_pip_is_refused_with_the_command_to_use_instead(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "pip", "install", "--no-deps", "--no-index", "--dry-run"]
    for target in ([str(ROOT)], ["-e", str(ROOT)]):
        done = subprocess.run([*command, *target], cwd=tmp_path, capture_output=True, text=True, timeout=300.0)
        assert done.returncode == 1 and "./rpbi setup " in done.stdout + done.stderr, done.stdout + done.stderr
