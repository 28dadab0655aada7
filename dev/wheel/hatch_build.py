"""Selects the files of the wheel: modules that need no ROS, with the worlds and robots that they name."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/support/runs"))

from import_graph import ImportGraph, imported_names, needing_ros  # noqa: E402

LEFT_OUT = re.compile(r"\.(console|ros)\.")
"""Part of the names of modules that are commands of `./rpbi`, or that look up modules which need ROS."""
SHARED = ("package.xml", "configs", "robots")
"""Files and folders of a ROS package that worlds name as `{package}/path`."""
SHARE = "custom_ros_tools/share"
"""Folder of the wheel with a subfolder for each ROS package; see `custom_ros_tools.config`."""


class CustomBuildHook(BuildHookInterface):
    """Adds each file to the wheel from its place in the source tree."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Fills `force_include`: the path in the wheel, by source."""
        packages = self.config["packages"]
        build_data["force_include"] |= modules(ROOT / "src", packages) | shared_files(ROOT / "src", packages)


def modules(src: Path, packages: list[str]) -> dict[str, str]:
    """Returns the path in the wheel of each module that needs neither ROS nor a package outside of the wheel.

    Commands are left out, and all in `ros` folders.

    Args:
        src: Folder of all ROS packages.
        packages: Names of the ROS packages whose modules are in the wheel.
    """
    everything = ImportGraph(*sorted(src.glob("*/src")))
    roots = [src / package / "src" for package in packages]
    names = {
        name
        for name, path in everything.files.items()
        if any(path.is_relative_to(root) for root in roots) and not LEFT_OUT.search(f"{name}.")
    }
    ours = {name.partition(".")[0] for name in names}
    others = {name.partition(".")[0] for name in everything.files} - ours
    lacking = {
        name: target
        for name in names
        for target in imported_names(everything.files[name], name, typing=False)
        if target.partition(".")[0] in others
    }
    left_out = needing_ros(everything).keys() | everything.leading_to(lacking).keys()
    paths = [everything.files[name] for name in sorted(names - left_out)]
    return {str(path): str(path.relative_to(root)) for path in paths for root in roots if path.is_relative_to(root)}


def shared_files(src: Path, packages: list[str]) -> dict[str, str]:
    """Returns the path in the wheel of each file that worlds may name.

    Args:
        src: Folder of all ROS packages.
        packages: Names of the ROS packages.
    """
    starts = [src / package / each for package in packages for each in SHARED]
    files = [path for start in starts for path in ([start] if start.is_file() else sorted(start.rglob("*")))]
    return {str(path): f"{SHARE}/{path.relative_to(src)}" for path in files if path.is_file()}
