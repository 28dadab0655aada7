"""How fast joints may go, and how fast that may change."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from xml.etree import ElementTree

import numpy as np

from rpbi.urdf import read_urdf

from .config import TrajectoryConfig


def largest_rates(config: TrajectoryConfig, joint_names: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Returns n largest speeds [rad/s or m/s] and accelerations [rad/s^2 or m/s^2], inf where there is no limit.

    Args:
        config: Options, which go before the URDF.
        joint_names: The n joints.
    """
    speeds = {**_velocities(config.urdf_filename), **config.velocity_limits}
    accelerations = config.acceleration_limits
    return (
        np.array([speeds.get(name, math.inf) for name in joint_names]),
        np.array([accelerations.get(name, math.inf) for name in joint_names]),
    )


def _velocities(urdf_filename: str) -> Mapping[str, float]:
    """Returns the speed limits of a URDF by joint; 0 means none, as in PyBullet."""
    limits = {
        joint.get("name", ""): float(limit.get("velocity", 0.0))
        for joint in ElementTree.fromstring(read_urdf(urdf_filename)).iterfind("joint")
        if (limit := joint.find("limit")) is not None
    }
    return {name: limit for name, limit in limits.items() if limit > 0.0}
