"""Why PyBullet could not load a robot description, of which it says little itself."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from ..asset_files import ROBOT_DESCRIPTION

MESH_FORMATS = (".obj", ".stl", ".dae", ".cdf")


def urdf_faults(path: str) -> list[str]:
    """Looks for the faults that are most likely in a URDF file that PyBullet has refused.

    Args:
        path: The file.

    Returns:
        A sentence for each; none if the reason is another.
    """
    if path == ROBOT_DESCRIPTION:
        return [f"there is no parameter '{ROBOT_DESCRIPTION}'"]
    try:
        root = ElementTree.parse(path).getroot()
    except OSError as error:
        return [f"{path}: {(error.strerror or str(error)).lower()}"]
    except ElementTree.ParseError as error:
        return [f"{path} is not XML: {error}"]
    if root.tag != "robot":
        return [f"{path}: expected <robot> at the top, got <{root.tag}>"]
    if root.find("link") is None and root.find("deformable") is None:
        return [f"{path}: the robot has no <link>"]
    faults = []
    for mesh in dict.fromkeys(element.get("filename", "") for element in root.iter("mesh")):
        if Path(mesh).suffix.lower() not in MESH_FORMATS:
            faults.append(f"{path}: mesh '{mesh}' is none of {', '.join(MESH_FORMATS)}")
        elif not any((folder / mesh).is_file() for folder in Path(path).absolute().parents):
            faults.append(f"{path}: no such mesh: {mesh} (looked for beside it and in all folders above)")
    return faults
