"""Forward kinematics of a chain as a CasADi function; Pinocchio's wheel comes without bindings to CasADi."""

from __future__ import annotations

import math
from typing import Any

import casadi
import numpy as np

from ik_ros.chain.description import ChainDescription
from rpbi.geometry import Pose
from rpbi.urdf.document import UrdfJoint


class ForwardKinematics:
    """Where the links of a chain are, for positions that are CasADi's symbols.

    Args:
        description: The chain; none of its joints mimics another.
    """

    def __init__(self, description: ChainDescription) -> None:
        self._description = description

    def frames(self, q: Any) -> dict[str, tuple[Any, Any]]:
        """Returns rotation (3 x 3) and position (3) [m] of each link in the base.

        Args:
            q: n positions [rad or m].
        """
        rotation: Any = casadi.DM.eye(3)
        position: Any = casadi.DM.zeros(3)
        frames = {self._description.base: (rotation, position)}
        variable = 0
        for joint in self._description.joints:
            position = position + rotation @ np.array(joint.xyz)
            rotation = rotation @ _from_rpy(*joint.rpy)
            if joint.is_moving:
                turn, shift = _motion(joint, q[variable])
                position = position + rotation @ shift
                rotation = rotation @ turn
                variable += 1
            frames[joint.child] = rotation, position
        return frames


def rotation_matrix(pose: Pose) -> np.ndarray:
    """Returns the 3 x 3 rotation matrix of a pose."""
    x, y, z, w = pose.quat_xyzw
    cross = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))
    return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross


def rotation_vector(rotation: Any) -> Any:
    """Returns axis times angle of a rotation that CasADi knows [rad], smooth but at half a turn."""
    trace = rotation[0, 0] + rotation[1, 1] + rotation[2, 2]
    w = 0.5 * casadi.sqrt(casadi.fmax(1.0 + trace, 1e-9))
    difference = (rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1])
    v = casadi.vertcat(*difference) / (4.0 * w)
    sine = casadi.sqrt(casadi.sumsqr(v) + 1e-16)
    return 2.0 * casadi.atan2(sine, w) / sine * v


def _motion(joint: UrdfJoint, q: Any) -> tuple[Any, Any]:
    """Returns how a joint turns and shifts what it carries, in its own frame."""
    axis = np.array(joint.axis)
    if not joint.is_revolute:
        return casadi.DM.eye(3), axis * q
    x, y, z = joint.axis
    cross = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))
    turn = casadi.DM.eye(3) + casadi.sin(q) * casadi.DM(cross) + (1.0 - casadi.cos(q)) * casadi.DM(cross @ cross)
    return turn, casadi.DM.zeros(3)


def _from_rpy(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Returns the rotation matrix of a URDF's angles: about the fixed x, y and z axes, one after the other [rad]."""
    (sr, sp, sy), (cr, cp, cy) = map(math.sin, (roll, pitch, yaw)), map(math.cos, (roll, pitch, yaw))
    return np.array(
        (
            (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
            (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
            (-sp, cp * sr, cp * cr),
        )
    )
