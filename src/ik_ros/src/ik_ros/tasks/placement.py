"""Poses as Pinocchio has them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from rpbi.pose import Pose


def to_se3(pose: Pose) -> Any:
    """Returns a pose as Pinocchio has it."""
    return pin.XYZQUATToSE3(np.array((*pose.position, *pose.quat_xyzw)))


def from_base(q: np.ndarray) -> Pose:
    """Returns the pose of a floating root in a configuration."""
    x, y, z, qx, qy, qz, qw = q[:7].tolist()
    return Pose((x, y, z), (qx, qy, qz, qw))
