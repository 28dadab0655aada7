"""Joints that let the root link of a robot description move in a plane."""

from .document import UrdfDocument, UrdfJoint
from .files import resolve_meshes, write_description

PLANAR_JOINTS = (0, 1, 2)
"""PyBullet's indices of the joints along x and y [m] and about z [rad], and of the links behind them."""


def with_planar_joints(path: str) -> str:
    """Puts a massless chain of joints along x, along y and about z between the world and a robot's root link.

    Args:
        path: The robot's URDF file.

    Returns:
        A copy of it with the chain, which lasts as long as the process; its root is the fixed end of the chain.

    Raises:
        ConfigError: If the file is not a tree of links, or a mesh of it does not exist.
    """
    document = UrdfDocument(path, source=resolve_meshes(path))
    world, x, y, yaw = (f"planar_base/{name}" for name in ("world", "x", "y", "yaw"))
    chain = (
        UrdfJoint(x, "prismatic", world, x, axis=(1.0, 0.0, 0.0)),
        UrdfJoint(y, "prismatic", x, y, axis=(0.0, 1.0, 0.0)),
        UrdfJoint(yaw, "continuous", y, document.root_link(), axis=(0.0, 0.0, 1.0)),
    )
    return write_description(document.mounted_on(chain))
