"""Symbolic kinematics of a chain in CasADi: link poses, and distances between spheres on links and obstacles.

Pinocchio cannot be used here, since its wheel lacks CasADi bindings.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import casadi
import numpy as np
from scipy.spatial.transform import Rotation

from ik_ros.shape import ShapeConfig
from robot_model.chain import Chain
from robot_model.urdf.elements import UrdfJoint

SMALL = 1e-12
"""Constant added to the arguments of square roots, so that the roots are differentiable everywhere [m^2]."""


def link_frames(chain: Chain, q: Any) -> dict[str, tuple[Any, Any]]:
    """Returns the pose of each link of a chain in the base frame, indexed by link name.

    Args:
        chain: The chain, which must not have mimic joints.
        q: Symbolic positions of the n joints [rad or m].

    Returns:
        Rotation matrix, 3 x 3, and position, 3 numbers [m], of each link.
    """
    rotation: Any = casadi.DM.eye(3)
    position: Any = casadi.DM.zeros(3)
    frames = {chain.base: (rotation, position)}
    variables = iter(range(len(chain.moving)))
    for joint in chain.joints:
        position = position + rotation @ np.array(joint.xyz)
        rotation = rotation @ Rotation.from_euler("xyz", joint.rpy).as_matrix()  # about each fixed axis in turn
        if joint.is_moving:
            turn, shift = _motion(joint, q[next(variables)])
            position = position + rotation @ shift
            rotation = rotation @ turn
        frames[joint.child] = rotation, position
    return frames


def sphere_distances(shapes: Sequence[ShapeConfig], frames: Mapping[str, tuple[Any, Any]]) -> list[Any]:
    """Returns the distance between each sphere on a link and each obstacle [m]; negative if they overlap.

    Args:
        shapes: Spheres on links of the chain, and obstacles, which are shapes fixed in the base frame.
        frames: Pose of each link in the base frame, see `link_frames`.
    """
    obstacles = [shape for shape in shapes if shape.link is None]
    distances = []
    for sphere in (shape for shape in shapes if shape.link is not None):
        rotation, position = frames[str(sphere.link)]
        centre = position + rotation @ np.array(sphere.position)
        distances += [_distance(centre, obstacle) - sphere.core.radius for obstacle in obstacles]
    return distances


def rotation_vector(rotation: Any) -> Any:
    """Converts a symbolic rotation matrix to a rotation vector [rad], smooth except at half a turn."""
    trace = rotation[0, 0] + rotation[1, 1] + rotation[2, 2]
    w = 0.5 * casadi.sqrt(casadi.fmax(1.0 + trace, 1e-9))
    difference = (rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1])
    v = casadi.vertcat(*difference) / (4.0 * w)
    sine = casadi.sqrt(casadi.sumsqr(v) + 1e-16)
    return 2.0 * casadi.atan2(sine, w) / sine * v


def _motion(joint: UrdfJoint, q: Any) -> tuple[Any, Any]:
    """Returns the rotation matrix and translation [m] by which a joint at position q moves its child link."""
    if not joint.is_revolute:
        return casadi.DM.eye(3), np.array(joint.axis) * q
    cross = casadi.skew(casadi.DM(joint.axis))
    turn = casadi.DM.eye(3) + casadi.sin(q) * cross + (1.0 - casadi.cos(q)) * (cross @ cross)
    return turn, casadi.DM.zeros(3)


def _distance(point: Any, obstacle: ShapeConfig) -> Any:
    """Returns the distance from a point to an obstacle's surface [m]; negative if the point is in the obstacle."""
    half, radius = obstacle.core
    local = Rotation.from_quat(obstacle.orientation).as_matrix().T @ (point - np.array(obstacle.position))
    if not obstacle.core.is_box:
        along = casadi.fmin(casadi.fmax(local[2], -half[2]), half[2])
        away = local - casadi.vertcat(0.0, 0.0, along)
        return casadi.sqrt(casadi.sumsqr(away) + SMALL) - radius
    over = casadi.fabs(local) - half
    outside = casadi.sqrt(casadi.sumsqr(casadi.fmax(over, 0.0)) + SMALL)
    return outside + casadi.fmin(casadi.mmax(over), 0.0)
