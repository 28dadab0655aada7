"""Loading a URDF file into a client."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import pybullet

from custom_ros_tools.errors import ConfigError, Problem

from ..client import Client
from ..urdf import resolve_meshes
from .urdf_faults import urdf_faults


def load_urdf(
    pb: Client, name: str, arguments: Mapping[str, Any], prepare: Callable[[str], str] = resolve_meshes
) -> int:
    """Loads a URDF file.

    Args:
        pb: The client.
        name: Name of the body, for messages.
        arguments: Those of `loadURDF`.
        prepare: Returns a file that PyBullet can load in place of `fileName`.

    Returns:
        PyBullet's id of the body.

    Raises:
        ConfigError: If it cannot be loaded; it tells what is wrong with the file.
    """
    file: str = arguments["fileName"]
    try:
        return int(pb.loadURDF(**{**arguments, "fileName": prepare(file)}))
    except ConfigError as error:
        messages = [f"{problem.key}: {problem.message}" for problem in error.problems]
    except (pybullet.error, OSError, UnicodeDecodeError) as error:
        messages = urdf_faults(file) or [f"PyBullet could not load it: {error}"]
    raise ConfigError([Problem(name, "loadURDF.fileName", message) for message in messages])
