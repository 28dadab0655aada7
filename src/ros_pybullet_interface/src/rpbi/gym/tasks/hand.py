"""Base class of tasks in which a robot's hand moves within a box-shaped workspace."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from pydantic import Field

from custom_ros_tools.schema import Name, Position, PositiveMetres, Text
from robot_model.geometry import Vector
from rpbi.gym.actions import HandAction
from rpbi.gym.parts import ObservationPart, link_index, robot_of
from rpbi.gym.task import WorldTask, WorldTaskConfig
from rpbi.world import World


class HandConfig(WorldTaskConfig):
    """Options of tasks in which a robot's hand moves within a box-shaped workspace."""

    robot: Name = Field(description="Name of the robot.")
    link: Text = Field(description="Link that actions move, the robot's hand.")
    low: Position = Field(
        description="Lower corner of the box that hand and objects must not leave, in the world frame."
    )
    high: Position = Field(
        description="Upper corner of the box that hand and objects must not leave, in the world frame."
    )
    step: PositiveMetres = Field(0.01, description="Largest translation of the hand along each axis in one action.")


class HandTask(WorldTask):
    """A task in which a robot's hand moves along axes of the world and keeps its orientation."""

    def __init__(self, world: World, config: HandConfig) -> None:
        super().__init__(world, config)
        self._link = link_index(robot_of(world, config.robot), config.link)

    def hand_action(self, axes: str = "xyz") -> HandAction:
        """Returns an action part that translates the hand along the axes of the world that `axes` names."""
        config = self.config
        return HandAction(self.world, config.robot, config.link, axes, config.low, config.high, config.step)

    def parts(self) -> Iterator[ObservationPart]:
        """Yields the parts of `WorldTask.parts`, then the position [m] of the hand in the world frame."""
        yield from super().parts()
        yield ObservationPart("hand", self.config.low, self.config.high, self.hand)

    def hand(self) -> Vector:
        """Returns the position [m] of the hand link in the world frame."""
        return self.world.bodies[self.config.robot].link_pose(self._link).position

    def position_of(self, name: str) -> Vector:
        """Returns the position [m] of a body's base in the world frame."""
        return self.world.bodies[name].base_pose().position

    def touches(self, name: str) -> Sequence[tuple[str, float]]:
        """Returns, for each of a body's contacts in the last tick, the other body's name and the normal force [N]."""
        body = self.world.bodies[name]
        points = self.world.contacts.sample(body, self.world.clock.tick).points
        return [(point.other_body, point.normal_force) for point in points]
