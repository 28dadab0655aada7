"""Options of the solver `trajectory`."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from custom_ros_tools.errors import UnknownNameError
from custom_ros_tools.schema import KeyedError, ListOf, NonNegative, Positive, Seconds
from ik_ros.chain.description import ChainDescription, read_chain
from ik_ros.chain.solver import refuse_mimics
from ik_ros.shape import ShapeConfig
from ik_ros.solvers.kdl import KdlConfig

MOST_INTERVALS = 128
"""Waypoints that follow each other faster than two intervals of the finest spline can hardly all be passed."""
MOST_WAYPOINTS = MOST_INTERVALS // 2
"""So there cannot be more, whatever their times."""


class TrajectoryConfig(KdlConfig):
    """Options of `trajectory`.

    Attributes:
        duration_s: Time to the target, for problems with a target and no waypoints [s].
        intervals: How many polynomials each joint's spline has at least.
        sample_s: Time between the positions of the answer [s].
        velocity_limits: Largest speed of joints [rad/s or m/s]; joints that are left out have that of the URDF.
        acceleration_limits: Largest acceleration of joints [rad/s^2 or m/s^2].
        shapes: Spheres on links, and obstacles in the base.
        clearance: How far all spheres stay away from all obstacles [m].
        attempts: How often to look for another way, by other positions at the waypoints.
    """

    duration_s: Seconds = 2.0
    intervals: Annotated[int, Field(ge=4, le=MOST_INTERVALS)] = 16
    sample_s: Seconds = 0.02
    velocity_limits: dict[str, Positive] = Field(default_factory=dict)
    acceleration_limits: dict[str, Positive] = Field(default_factory=dict)
    shapes: ListOf[ShapeConfig] = ()
    clearance: NonNegative = 0.0
    attempts: Annotated[int, Field(ge=1)] = 3

    @model_validator(mode="after")
    def _fits_the_chain(self) -> TrajectoryConfig:
        chain = read_chain(self.urdf_filename, self.base_link, self.tip_link)
        refuse_mimics(chain, self, "trajectory")
        for key in ("velocity_limits", "acceleration_limits"):
            for name in getattr(self, key):
                if name not in chain.joint_names:
                    raise KeyedError(key, str(UnknownNameError("joint", name, chain.joint_names)))
        links = [chain.base, *(joint.child for joint in chain.joints)]
        for i, shape in enumerate(self.shapes):
            if shape.link is not None and shape.link not in links:
                raise KeyedError(f"shapes[{i}].link", str(UnknownNameError("link of the chain", shape.link, links)))
            if shape.link is not None and shape.sphere is None:
                raise KeyedError(f"shapes[{i}]", "shapes on links must be spheres; several can stand for one link")
        return self


def largest_rates(config: TrajectoryConfig, description: ChainDescription) -> tuple[np.ndarray, np.ndarray]:
    """Returns n largest speeds [rad/s or m/s] and accelerations [rad/s^2 or m/s^2], inf where there is no limit.

    Args:
        config: Options, which go before the URDF.
        description: The chain, with the URDF's speeds of its n joints.
    """
    speeds = dict(zip(description.joint_names, description.velocity_limits)) | config.velocity_limits
    accelerations = dict.fromkeys(description.joint_names, math.inf) | config.acceleration_limits
    return np.array(list(speeds.values())), np.array(list(accelerations.values()))
