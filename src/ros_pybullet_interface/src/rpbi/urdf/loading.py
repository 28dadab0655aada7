"""Loading a URDF into PyBullet, and what is wrong with one that cannot be loaded."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pybullet

from custom_ros_tools.errors import ConfigError, Problem
from rpbi.config.asset_files import ROBOT_DESCRIPTION
from rpbi.engine.client import Client

from .document import UrdfDocument
from .files import beside_or_above, resolve_meshes

MESH_FORMATS = (".obj", ".stl", ".dae", ".cdf")


def urdf_problems(path: str) -> list[str]:
    """Returns a sentence for each problem that is likely in a URDF file that PyBullet has refused, if there is any."""
    if path == ROBOT_DESCRIPTION:
        return [f"there is no parameter '{ROBOT_DESCRIPTION}'"]
    try:
        document = UrdfDocument(path)
    except ConfigError as error:
        return [str(error).replace(": is not XML", " is not XML")]
    if document.tag != "robot":
        return [f"{path}: expected <robot> at the top, got <{document.tag}>"]
    if not document.links and not document.is_soft:
        return [f"{path}: the robot has no <link>"]
    problems = []
    for mesh in document.meshes:
        if Path(mesh).suffix.lower() not in MESH_FORMATS:
            problems.append(f"{path}: mesh '{mesh}' is none of {', '.join(MESH_FORMATS)}")
        elif beside_or_above(mesh, Path(path)) is None:
            problems.append(f"{path}: no such mesh: {mesh} (looked for beside it and in all folders above)")
    return problems


def load_urdf(
    pb: Client, name: str, arguments: Mapping[str, Any], prepare: Callable[[str], str] = resolve_meshes
) -> int:
    """Loads a URDF file and returns PyBullet's id of the body.

    Args:
        name: Name of the body, for messages.
        arguments: Those of `loadURDF`.
        prepare: Returns a file that PyBullet can load in place of `fileName`.

    Raises:
        ConfigError: If it cannot be loaded; it names what is wrong with the file.
    """
    file: str = arguments["fileName"]
    try:
        return int(pb.loadURDF(**{**arguments, "fileName": prepare(file)}))
    except ConfigError as error:
        messages = [f"{problem.key or file}: {problem.message}" for problem in error.problems]
    except (pybullet.error, OSError, UnicodeDecodeError) as error:
        messages = urdf_problems(file) or [f"PyBullet could not load it: {error}"]
    raise ConfigError([Problem(name, "loadURDF.fileName", message) for message in messages])
