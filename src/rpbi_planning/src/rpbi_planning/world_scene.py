"""The robots and bodies of a simulated world as a planning scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from custom_ros_tools.errors import ConfigError, Problem
from robot_model.geometry import Pose
from rpbi.bodies.robots.jointed import JointedBody
from rpbi.bodies.robots.visual_robot import VisualRobot
from safe_robot.world_obstacles import shapes_of_body

from .scene import PlanningScene

if TYPE_CHECKING:
    from rpbi.world import World


def fill(scene: PlanningScene, world: World) -> None:
    """Adds, moves and removes robots and bodies, so that a scene contains those of a world in their present states.

    Bodies that robots hold in the scene keep their pose in the link.

    Raises:
        ConfigError: If a body has a shape that cannot be checked, or a robot is scaled or has a moving base.
    """
    seen = set[str]()
    for name, body in world.bodies.items():
        if body.is_soft or isinstance(body, VisualRobot):
            continue
        if isinstance(body, JointedBody):
            _fill_robot(scene, name, body)
            seen.add(name)
            continue
        shapes = list(shapes_of_body(body, name))
        if not shapes:
            continue
        seen.add(name)
        if name in scene.held:
            continue
        pose = Pose(*body.base_pose())
        inverse = pose.inverse()
        if name in scene.bodies and len(scene.bodies[name]) == len(shapes):
            scene.place(name, pose)
        else:
            scene.add([each._replace(pose=inverse @ each.pose) for each in shapes], name, pose)
    for name in [name for name in scene.names if name not in seen]:
        scene.remove(name)


def _fill_robot(scene: PlanningScene, name: str, body: JointedBody) -> None:
    load = body.config.loadURDF
    if (load.globalScaling or 1.0) != 1.0:
        message = f"expected no scaling of a robot to plan for, got {load.globalScaling:g}"
        raise ConfigError([Problem(name, "loadURDF.globalScaling", message)])
    measured = body.joint_positions()
    by_name = {joint.name: measured[joint.index] for joint in body.model.moving}
    base = Pose(*body.base_pose())
    if name not in scene.robots:
        scene.add_robot(name, load.fileName, base)
        robot = scene.robots[name]
        robot.positions = np.array([by_name.get(joint, 0.0) for joint in robot.model.joint_names])
        robot.postures["start"] = robot.positions.copy()
    else:
        scene.place(name, base)
        robot = scene.robots[name]
        robot.positions = np.array([by_name.get(joint, 0.0) for joint in robot.model.joint_names])
