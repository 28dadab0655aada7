"""A type of object: a belt that carries what lies on it."""

import math
from typing import Annotated

from pydantic import Field

from custom_ros_tools.schema import NonNegative, Position, Unit, Vec3
from rpbi.bodies import Body, BodyConfig
from rpbi.engine.client import Client
from rpbi.engine.inputs import Input
from rpbi.geometry import Pose

FASTEST = 5.0
"""What the belt takes for a speed at most [m/s]."""


class ConveyorConfig(BodyConfig):
    """YAML of a conveyor belt; `name` and `sensors` every object has."""

    size: Annotated[Vec3, Unit("m")] = Field(description="Length along x, width along y, height along z.")
    position: Position = Field(description="Where its middle is.")
    speed: Annotated[float, Field(ge=-FASTEST, le=FASTEST), Unit("m/s")] = Field(0.0, description="Speed along x.")
    friction: NonNegative = Field(1.0, description="Friction coefficient of its surface.")


class Conveyor(Body):
    """A box that stays where it is while its surface moves along x."""

    Config = ConveyorConfig

    def __init__(self, pb: Client, config: ConveyorConfig) -> None:
        half = [extent / 2 for extent in config.size]
        body_id = pb.createMultiBody(
            baseMass=0.0,
            baseCollisionShapeIndex=pb.createCollisionShape(pb.GEOM_BOX, halfExtents=half),
            baseVisualShapeIndex=pb.createVisualShape(pb.GEOM_BOX, halfExtents=half, rgbaColor=[0.2, 0.2, 0.2, 1.0]),
            basePosition=config.position,
        )
        super().__init__(pb, config.name, body_id)
        pb.changeDynamics(body_id, -1, lateralFriction=config.friction)
        self._pose = self.base_pose()
        self._speed = config.speed

    def before_step(self, tick: int) -> None:
        """Gives the box its velocity, which contacts feel, and undoes how far it has moved by that."""
        self.set_base_pose(self._pose)
        self.pb.resetBaseVelocity(self.body_id, (self._speed, 0.0, 0.0), (0.0, 0.0, 0.0))

    def teleport(self, pose: Pose) -> None:
        """Puts the belt somewhere else; the service `rpbi/NAME/set_pose` does so."""
        self._pose = pose
        super().teleport(pose)

    def inputs(self) -> dict[str, Input]:
        """Takes `speed` [m/s]."""
        return {"speed": Input(_checked_speed, self._set_speed, ros_topic="my_robot_lab.ros.topics:SPEED")}

    def _set_speed(self, speed: float) -> None:
        self._speed = speed


def _checked_speed(speed: float) -> float:
    """Returns the speed; what raises ValueError is refused, with a warning that names the topic."""
    if not math.isfinite(speed) or abs(speed) > FASTEST:
        raise ValueError(f"speed must be within +-{FASTEST:g} m/s, got {speed:g}")
    return speed
