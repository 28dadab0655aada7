"""The version of the workspace: it is in one package.xml, and `./rpbi docs` writes it into all other files."""

import re
from pathlib import Path

from catkin_pkg.package import parse_package

SOURCE = "src/ros_pybullet_interface/package.xml"
"""The file in which the version is changed."""
VERSION = re.compile(r"(?<=<version>)[^<]*(?=</version>)|(?<=^version: ).*$", re.MULTILINE)
"""The version in a package.xml, and in CITATION.cff."""


def version(root: Path) -> str:
    """Returns the version of a workspace, such as `1.0.0`."""
    return str(parse_package(root / SOURCE).version)


def version_files(root: Path) -> dict[Path, str]:
    """Returns the texts of all files of a workspace that state its version, by path."""
    current = version(root)
    paths = (*sorted(root.glob("src/**/package.xml")), root / "CITATION.cff")
    return {path: VERSION.sub(current, path.read_text(encoding="utf-8"), count=1) for path in paths}
