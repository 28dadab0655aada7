"""Controller that pushes along one axis and holds a pose in the other directions."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import Field, WithJsonSchema, field_validator

from custom_ros_tools.schema import NonNegative, Positive, Text, Unit, Vec3

from .cartesian_impedance import CartesianImpedanceConfig, CartesianImpedanceController
from .controller import Array, ControlledRobot


class ForceControllerConfig(CartesianImpedanceConfig):
    """Configuration of a `force` controller."""

    type: Annotated[Text, WithJsonSchema({"enum": ["force"]})] = Field(
        description="`force`, or a class that accepts the same keys."
    )

    axis: Vec3 = Field((0.0, 0.0, -1.0), description="Direction of the force in the world frame.")
    force: Annotated[NonNegative, Unit("N")] = Field(10.0, le=1000.0, description="Magnitude of the contact force.")
    approach_speed: Annotated[Positive, Unit("m/s")] = Field(0.05, description="Speed along `axis` until contact.")

    @field_validator("axis")
    @classmethod
    def _has_a_direction(cls, axis: tuple[float, float, float]) -> tuple[float, float, float]:
        if np.linalg.norm(axis) < 1e-6:
            raise ValueError(f"expected a direction, got {list(axis)}")
        return axis


class ForceController(CartesianImpedanceController):
    """Pushes along an axis with a configured force, and pulls a point to a target pose in all other directions.

    While the point is not in contact, a damper along the axis limits the speed. Once the point rests in contact, the
    configured force acts. The target's position along the axis is ignored.
    """

    Config = ForceControllerConfig

    def __init__(self, arm: ControlledRobot, config: Any) -> None:
        super().__init__(arm, config)
        axis = np.array(config.axis) / np.linalg.norm(config.axis)
        side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        side /= np.linalg.norm(side)
        turn = np.column_stack((axis, side, np.cross(axis, side)))
        self._axes = np.kron(np.eye(2), turn)
        self._stiffness[0] = 0.0
        self._push[0] = config.force

    def _damping(self, mobility: Array) -> Array:
        damping = super()._damping(mobility)
        damping[0] = self.config.force / self.config.approach_speed
        return damping
