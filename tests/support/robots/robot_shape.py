"""The surface of a robot, from its description, and where TF puts it."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pybullet
from geometry_msgs.msg import Transform
from rendering import rotation_matrix

Array = npt.NDArray[np.float64]


def link_triangles(description: Path, package: Path) -> dict[str, Array]:
    """Returns the visual meshes of each link that has any.

    Args:
        description: URDF whose visuals are Wavefront meshes.
        package: The folder that `package://` with its name stands for.

    Returns:
        Corners of the triangles in the link's frame [m], shape (n, 3, 3), by name of the link.
    """
    triangles: dict[str, Array] = {}
    for link in ElementTree.parse(description).getroot().iter("link"):
        meshes = []
        for visual in link.iter("visual"):
            name = visual.find("geometry/mesh").attrib["filename"]
            mesh = read_obj(package / name.removeprefix(f"package://{package.name}/"))
            origin = visual.find("origin")
            attributes = {} if origin is None else origin.attrib
            xyz = [float(number) for number in attributes.get("xyz", "0 0 0").split()]
            rpy = [float(number) for number in attributes.get("rpy", "0 0 0").split()]
            meshes.append(mesh @ rotation_matrix(pybullet.getQuaternionFromEuler(rpy)).T + xyz)
        if meshes:
            triangles[link.attrib["name"]] = np.concatenate(meshes)
    return triangles


def pose_matrix(transform: Transform) -> Array:
    """Returns a transform as a 4x4 matrix."""
    position, quat = transform.translation, transform.rotation
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_matrix((quat.x, quat.y, quat.z, quat.w))
    matrix[:3, 3] = position.x, position.y, position.z
    return matrix


def moved(points: Array, pose: Array) -> Array:
    """Returns points of a frame in the frame that its pose is told in; shape (..., 3)."""
    return points @ pose[:3, :3].T + pose[:3, 3]


def read_obj(path: Path) -> Array:
    """Returns the triangles of a Wavefront mesh, shape (n, 3, 3)."""
    vertices, faces = [], []
    for line in path.read_text().splitlines():
        kind, *words = line.split() or [""]
        if kind == "v":
            vertices.append([float(word) for word in words])
        elif kind == "f":
            faces.append([int(word.split("/")[0]) - 1 for word in words])
    return np.array(vertices)[np.array(faces)]
