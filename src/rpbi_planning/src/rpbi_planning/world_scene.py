"""The robots and bodies of a simulated world, as they enter a planning scene."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

from custom_ros_tools.errors import ConfigError, Problem
from robot_model.collision.shapes import Obstacle
from robot_model.geometry import Pose
from rpbi.bodies.robots.jointed import JointedBody
from rpbi.bodies.robots.visual_robot import VisualRobot
from safe_robot.world_obstacles import shapes_of_body

if TYPE_CHECKING:
    from rpbi.world import World


class WorldRobot(NamedTuple):
    """A robot of a world.

    Attributes:
        name: Name of the robot.
        urdf: Path of the URDF.
        base: Pose of the root link in the world.
        positions: Position of each moving joint, by joint name [rad or m].
    """

    name: str
    urdf: str
    base: Pose
    positions: Mapping[str, float]


class WorldBody(NamedTuple):
    """A body of a world.

    Attributes:
        name: Name of the body.
        shapes: Shapes of the body, in the frame of the body.
        pose: Pose of the body in the world.
    """

    name: str
    shapes: tuple[Obstacle, ...]
    pose: Pose


def contents_of(world: World) -> Iterator[WorldRobot | WorldBody]:
    """Yields the robots and bodies of a world in their present states; soft and visual ones are left out.

    Raises:
        ConfigError: If a body has a shape that cannot be checked, or a robot is scaled.
    """
    for name, body in world.bodies.items():
        if body.is_soft or isinstance(body, VisualRobot):
            continue
        base = Pose(*body.base_pose())
        if isinstance(body, JointedBody):
            load = body.config.loadURDF
            if (load.globalScaling or 1.0) != 1.0:
                message = f"expected no scaling of a robot to plan for, got {load.globalScaling:g}"
                raise ConfigError([Problem(name, "loadURDF.globalScaling", message)])
            measured = body.joint_positions()
            positions = {joint.name: measured[joint.index] for joint in body.model.moving}
            yield WorldRobot(name, load.fileName, base, positions)
        elif shapes := tuple(shapes_of_body(body, name)):
            inverse = base.inverse()
            yield WorldBody(name, tuple(each._replace(pose=inverse @ each.pose) for each in shapes), base)
