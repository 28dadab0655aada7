"""Segment lengths of an avatar, from its URDF."""

import tempfile

import numpy as np

from custom_ros_tools.errors import ConfigError, Problem
from operator_node.mvn.segments import SEGMENTS
from robot_model.urdf.document import UrdfDocument

from .anthropometry import Array
from .joints import HINGES, JOINTS


def urdf_offsets(name: str, text: str) -> Array:
    """Returns the origin of each segment in its parent (23 x 3) [m].

    Args:
        name: Source of the URDF, for messages.
        text: The URDF.

    Raises:
        ConfigError: If it is not valid, or lacks a hinge of a person.
    """
    with tempfile.NamedTemporaryFile("w", suffix=".urdf") as file:
        file.write(text)
        file.flush()
        found = UrdfDocument(name, file.name).joints
    if missing := [hinge for hinge in HINGES if hinge not in found]:
        message = f"expected the joints of a person, as in human_urdf.py; it lacks '{missing[0]}'"
        raise ConfigError([Problem(name, "", message)])
    offsets = np.zeros((len(SEGMENTS), 3))
    for index, joint in enumerate(JOINTS, start=1):
        offsets[index] = np.sum([found[hinge].xyz for hinge in joint.hinges], axis=0)
    return offsets
