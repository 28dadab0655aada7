"""The task `lift`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import ListOf, Name, PositiveMetres, Text
from rpbi.gym.actions import ActionPart, GripperAction
from rpbi.gym.parts import ObservationPart, pose_part
from rpbi.world import World

from .hand import HandConfig, HandTask


class LiftConfig(HandConfig):
    """Options of the task `lift`."""

    object: Name = Field(description="Name of the body that is lifted.")
    fingers: ListOf[Text] = Field(
        min_length=1, description="Names of the finger joints, which open and close together."
    )
    finger_step: PositiveMetres = Field(
        0.005, description="Largest change of the finger joints' positions in one action."
    )
    height: PositiveMetres = Field(0.1, description="Height above the body's start at which the body counts as lifted.")


class LiftTask(HandTask):
    """Grasps a body and lifts it."""

    Config = LiftConfig

    def __init__(self, world: World, config: LiftConfig) -> None:
        super().__init__(world, config)
        world.dynamics(config.object)  # checks that it exists
        self._start_height = 0.0

    def actions(self) -> Sequence[ActionPart]:
        """Returns the action parts for translating the hand and for moving the fingers."""
        config = self.config
        return [self.hand_action(), GripperAction(self.world, config.robot, config.fingers, config.finger_step)]

    def parts(self) -> Iterator[ObservationPart]:
        """Yields the parts of `HandTask.parts`, then the pose of the body to lift."""
        yield from super().parts()
        yield pose_part(self.world, self.config.object, self.config.low, self.config.high)

    def reset(self, random: np.random.Generator) -> None:
        """Records the start height of the body."""
        self._start_height = self.position_of(self.config.object)[2]
        super().reset(random)

    def lifted(self) -> float:
        """Returns the height [m] of the body above its start height."""
        return self.position_of(self.config.object)[2] - self._start_height

    def reward(self) -> float:
        """Returns the height of the body above its start height, minus the distance between hand and body [m]."""
        return self.lifted() - math.dist(self.hand(), self.position_of(self.config.object))

    def has_succeeded(self) -> bool:
        """Returns whether the body is high enough, and only the robot touches the body."""
        if self.lifted() < self.config.height:
            return False
        return {other for other, _ in self.touches(self.config.object)} == {self.config.robot}
