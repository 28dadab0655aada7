"""How fast joints may go, and how fast that may change."""

from __future__ import annotations

import math

import numpy as np

from ..chain_description import ChainDescription
from .config import TrajectoryConfig


def largest_rates(config: TrajectoryConfig, description: ChainDescription) -> tuple[np.ndarray, np.ndarray]:
    """Returns n largest speeds [rad/s or m/s] and accelerations [rad/s^2 or m/s^2], inf where there is no limit.

    Args:
        config: Options, which go before the URDF.
        description: The chain, with the URDF's speeds of its n joints.
    """
    speeds = dict(zip(description.joint_names, description.velocity_limits)) | config.velocity_limits
    accelerations = dict.fromkeys(description.joint_names, math.inf) | config.acceleration_limits
    return np.array(list(speeds.values())), np.array(list(accelerations.values()))
