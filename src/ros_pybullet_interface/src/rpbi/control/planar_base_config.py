"""What YAML may say about a planar base."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Positive, Seconds, Unit


class PlanarBaseConfig(ConfigModel):
    """How a base drives over the ground; all in the base frame."""

    max_linear_velocity: Annotated[Positive, Unit("m/s")] = Field(1.0, description="Largest speed in any direction.")
    max_angular_velocity: Annotated[Positive, Unit("rad/s")] = Field(1.5, description="Fastest rotation.")
    max_linear_acceleration: Annotated[Positive, Unit("m/s^2")] = Field(
        1.0, description="Largest change of the velocity, when it brakes as well."
    )
    max_angular_acceleration: Annotated[Positive, Unit("rad/s^2")] = Field(
        3.0, description="Largest change of the rotation."
    )
    max_force: Annotated[Positive, Unit("N")] | None = Field(
        None, description="Largest push along each axis of the plane; without it, the weight of the robot."
    )
    max_torque: Annotated[Positive, Unit("N m")] | None = Field(
        None, description="Largest torque about the vertical; without it, the weight at the radius of gyration."
    )
    cmd_vel_timeout_s: Seconds = Field(
        0.5, description="Age at which a velocity expires and the base brakes, in the world's time."
    )
