"""The scene of a plan: robots, bodies around them, and bodies that robots hold."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from custom_ros_tools.errors import ConfigError, InterfaceError, Problem, UnknownNameError
from robot_model.asset_files import find_file
from robot_model.collision.shapes import Obstacle
from robot_model.geometry import Pose, normalized
from robot_model.limits import MAX_MAGNITUDE
from robot_model.model import RobotModel
from safe_robot.limits import LimitsConfig

from .scene_robot import DEFAULT_LIMITS, SceneRobot

if TYPE_CHECKING:
    from rpbi.world import World

MAX_SHAPES = 5_000
"""Largest number of shapes of bodies in a scene."""
MAX_MESH_MB = 32.0
"""Largest file of a mesh of a body [MB]; a binary STL file has 50 bytes for each triangle."""


class Held(NamedTuple):
    """A body that a robot holds.

    Attributes:
        robot: Name of the robot.
        link: Link that the body moves with.
        pose: Pose of the body in the link.
        touching: Links that may touch the body.
    """

    robot: str
    link: str
    pose: Pose
    touching: frozenset[str]


class PlanningScene:
    """Robots and bodies for which motions are planned. All poses are in the world frame.

    Attributes:
        robots: The robots, indexed by name.
        bodies: Shapes of each body, in the frame of the body, indexed by the body's name.
        poses: Pose of each body, indexed by name; bodies that are held move with their link.
        held: The bodies that robots hold, indexed by the body's name.
        allowed: Pairs of names that may touch: bodies, or links as `robot/link`.
        padding_m: Least distance from bodies and from other robots [m].
        self_padding_m: Least distance between links of one robot [m].
        kept_by_planners: Description of the scene of the last plan, and data that planners keep for this scene.
        kept_model: The collision model of the last plan, and a description of the scene for which it is valid.
        version: Number of changes of robots, bodies and attachments; poses and joint positions do not count.
    """

    def __init__(self, padding_m: float = 0.01, self_padding_m: float = 0.005) -> None:
        self.robots: dict[str, SceneRobot] = {}
        self.bodies: dict[str, tuple[Obstacle, ...]] = {}
        self.poses: dict[str, Pose] = {}
        self.held: dict[str, Held] = {}
        self.allowed: set[frozenset[str]] = set()
        self.padding_m, self.self_padding_m = padding_m, self_padding_m
        self.version = 0
        self.kept_by_planners: tuple[Any, dict[str, Any]] = (None, {})
        self.kept_model: tuple[Any, Any] = (None, None)

    @classmethod
    def from_yaml(cls, path: str | Path, **options: float) -> PlanningScene:
        """Reads the robots and bodies of a world file, at their start poses.

        Args:
            path: Main YAML file of the world; `{package}/path` is resolved.
            options: `padding_m` and `self_padding_m`, see the attributes.

        Raises:
            ConfigError: If the world cannot be loaded, or has no robot or a shape that cannot be checked.
        """
        import pybullet

        from rpbi.world import World

        world = World.from_file(find_file(str(path), str(Path.cwd() / "~")), connection_mode=pybullet.DIRECT)
        try:
            scene = cls.of_world(world, **options)
        finally:
            world.close()
        if not scene.robots:
            message = "expected a world with a robot, got none; add one to 'robots'"
            raise ConfigError([Problem(str(path), "robots", message)])
        return scene

    @classmethod
    def of_world(cls, world: World, **options: float) -> PlanningScene:
        """Returns the robots and bodies of a world in their present states. Soft and visual bodies are left out."""
        scene = cls(**options)
        scene.update(world)
        return scene

    def update(self, world: World) -> None:
        """Takes poses, joint positions, new and removed bodies from a world. Held bodies stay held.

        Raises:
            ConfigError: If a body has a shape that cannot be checked, or a robot is scaled.
        """
        from .world_scene import WorldRobot, contents_of

        seen = set[str]()
        for each in contents_of(world):
            seen.add(each.name)
            if isinstance(each, WorldRobot):
                is_new = each.name not in self.robots
                if is_new:
                    self.add_robot(each.name, each.urdf, each.base)
                self.place(each.name, each.base)
                robot = self.robots[each.name]
                robot.positions = np.array([each.positions.get(joint, 0.0) for joint in robot.model.joint_names])
                if is_new:
                    robot.postures["start"] = robot.positions.copy()
            elif each.name in self.held:
                continue
            elif each.name in self.bodies and len(self.bodies[each.name]) == len(each.shapes):
                self.place(each.name, each.pose)
            else:
                self.add(each.shapes, each.name, each.pose)
        for name in [name for name in self.names if name not in seen]:
            self.remove(name)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all robots and bodies."""
        return (*self.robots, *self.bodies)

    def robot(self, name: str) -> SceneRobot:
        """Returns a robot.

        Raises:
            InterfaceError: If the scene has no robot.
            UnknownNameError: If the scene does not have this robot.
        """
        if not self.robots:
            raise InterfaceError("expected a scene with a robot, got a scene without robots: add one with add_robot")
        if name not in self.robots:
            raise UnknownNameError("robot", name, self.robots)
        return self.robots[name]

    def add_robot(
        self,
        name: str,
        urdf: str,
        base: Pose = Pose(),
        positions: Sequence[float] | None = None,
        limits: LimitsConfig = DEFAULT_LIMITS,
        joint_names: Sequence[str] = (),
    ) -> SceneRobot:
        """Adds a robot from a URDF, or replaces the robot with this name.

        Raises:
            ConfigError: If the URDF is invalid.
            ValueError: If a body has this name.
        """
        if name in self.bodies:
            raise ValueError(f"name: there is a body '{name}' already")
        model = RobotModel(urdf, joint_names)
        self.robots[name] = SceneRobot(name, model, _checked(base), positions, limits)
        self.version += 1
        return self.robots[name]

    def add(self, shapes: Obstacle | Iterable[Obstacle], name: str = "", pose: Pose | None = None) -> str:
        """Adds a body, or replaces the body with this name.

        Args:
            shapes: Shapes of the body. Without `pose`, the poses of shapes are in the world, and the frame of the body
                is that of the first shape. With `pose`, the poses of shapes are in the body's frame.
            name: Name of the body; by default the name of the first shape.
            pose: Pose of the body.

        Returns:
            The name of the body.

        Raises:
            ValueError: If there is no shape, a number is not finite, a mesh is too large, or a robot has this name.
            OSError: If the file of a mesh cannot be read.
        """
        given = (shapes,) if isinstance(shapes, Obstacle) else tuple(shapes)
        if not given:
            raise ValueError(f"shapes: expected a shape for '{name}', got none")
        name = name or given[0].name
        if name in self.robots:
            raise ValueError(f"name: there is a robot '{name}' already")
        for shape in given:
            if not np.isfinite((*shape.size, *shape.pose.position, *shape.pose.quat_xyzw)).all():
                raise ValueError(f"'{name}': expected finite numbers, got {shape}")
            if min(shape.size) < 0.0:
                raise ValueError(f"'{name}': expected a size that is not negative, got {shape.size}")
            if shape.mesh_file and (size_mb := Path(shape.mesh_file).stat().st_size / 1e6) > MAX_MESH_MB:
                message = f"expected a mesh of at most {MAX_MESH_MB:g} MB, got {size_mb:.0f} MB: reduce its triangles"
                raise ValueError(f"'{name}': {shape.mesh_file}: {message}")
        others = sum(len(each) for other, each in self.bodies.items() if other != name)
        if others + len(given) > MAX_SHAPES:
            raise ValueError(f"'{name}': expected at most {MAX_SHAPES} shapes in a scene, got {others + len(given)}")
        if pose is None:
            pose, inverse = given[0].pose, given[0].pose.inverse()
            given = tuple(shape._replace(pose=inverse @ shape.pose) for shape in given)
        self.poses[name] = _checked(pose)
        if self.bodies.get(name) != given:
            self.bodies[name] = given
            self.version += 1
        return name

    def remove(self, name: str) -> None:
        """Removes a body, also from the robot that holds it, or a robot and what it holds.

        Raises:
            UnknownNameError: If there is no such body or robot.
        """
        if name in self.robots:
            del self.robots[name]
            for body in [body for body, held in self.held.items() if held.robot == name]:
                self.detach(body)
        elif name in self.bodies:
            del self.bodies[name], self.poses[name]
            self.held.pop(name, None)
        else:
            raise UnknownNameError("body", name, self.names)
        self.version += 1

    def place(self, name: str, pose: Pose) -> None:
        """Moves a body, or the base of a robot, to a pose in the world.

        Raises:
            UnknownNameError: If there is no such body or robot.
            ValueError: If a number is not finite, or a robot holds the body.
        """
        if name in self.robots:
            checked = _checked(pose)
            if self.robots[name].base != checked:
                self.robots[name].base = checked
                self.version += 1
        elif name in self.bodies:
            if name in self.held:
                raise ValueError(f"'{name}': robot '{self.held[name].robot}' holds this body; detach it first")
            self.poses[name] = _checked(pose)
        else:
            raise UnknownNameError("body", name, self.names)

    def set_positions(self, robot: str, positions: Mapping[str, float] | Sequence[float]) -> None:
        """Sets joint positions of a robot [rad or m]."""
        self.robot(robot).positions = self.robots[robot].vector(positions, "positions")

    def attach(self, body: str, robot: str, link: str, touching: Iterable[str] | None = None) -> None:
        """Makes a body move with a link of a robot, from its present pose in the link.

        Args:
            body: Name of the body.
            robot: Name of the robot.
            link: Link of the robot.
            touching: Links that may touch the body; by default the link, and all links that fixed joints or one moving
                joint connect to it, such as fingers.

        Raises:
            UnknownNameError: If a name is unknown.
            ValueError: If a robot holds the body already.
        """
        owner = self.robot(robot)
        if body not in self.bodies:
            raise UnknownNameError("body", body, self.bodies)
        if body in self.held:
            raise ValueError(f"'{body}': robot '{self.held[body].robot}' holds this body already")
        owner.model.check_link(link)
        near = {link} if touching is None else {owner.model.check_link(each) for each in touching}
        if touching is None:
            near |= _hand(owner.model, link)
        pose = self.link_pose(robot, link).inverse() @ self.poses[body]
        self.held[body] = Held(robot, link, pose, frozenset(near))
        self.version += 1

    def detach(self, body: str) -> None:
        """Releases a body at its present pose.

        Raises:
            UnknownNameError: If no robot holds the body.
        """
        if body not in self.held:
            raise UnknownNameError("held body", body, self.held)
        pose = self.body_pose(body)
        del self.held[body]
        self.poses[body] = pose
        self.version += 1

    def allow(self, first: str, second: str) -> None:
        """Allows two bodies or links to touch. Links are named `robot/link`; a robot's name means all of its links."""
        self.allowed.add(frozenset((first, second)))
        self.version += 1

    def forbid(self, first: str, second: str) -> None:
        """Undoes `allow`."""
        self.allowed.discard(frozenset((first, second)))
        self.version += 1

    def link_pose(self, robot: str, link: str, positions: Sequence[float] | None = None) -> Pose:
        """Returns the pose of a link in the world, by default in the robot's present configuration."""
        owner = self.robot(robot)
        return owner.base @ owner.model.pose(owner.positions.tolist() if positions is None else positions, link)

    def body_pose(self, body: str) -> Pose:
        """Returns the pose of a body in the world.

        Raises:
            UnknownNameError: If there is no such body.
        """
        if body not in self.bodies:
            raise UnknownNameError("body", body, self.bodies)
        held = self.held.get(body)
        return self.poses[body] if held is None else self.link_pose(held.robot, held.link) @ held.pose

    def obstacles_for(self, robot: str) -> tuple[Obstacle, ...]:
        """Returns all bodies that no robot holds as obstacles for a guard, in the frame of a robot's root link."""
        inverse = self.robot(robot).base.inverse()
        return tuple(
            shape._replace(name=body, pose=inverse @ self.poses[body] @ shape.pose)
            for body, shapes in self.bodies.items()
            if body not in self.held
            for shape in shapes
        )


def _checked(pose: Pose) -> Pose:
    numbers = (*pose.position, *pose.quat_xyzw)
    if not (np.isfinite(numbers).all() and max(map(abs, numbers)) <= MAX_MAGNITUDE and any(pose.quat_xyzw)):
        raise ValueError(f"pose: expected finite numbers and a quaternion that is not zero, got {pose}")
    x, y, z = map(float, pose.position)
    return Pose((x, y, z), normalized(pose.quat_xyzw))


def _hand(model: RobotModel, link: str) -> set[str]:
    """Returns the links that fixed joints connect to a link, and links below these by at most one moving joint."""
    rigid, joints = {link}, list(model.all_joints.values())
    for _ in joints:
        rigid |= {
            end
            for each in joints
            if not each.is_moving
            for end in (each.parent, each.child)
            if {each.parent, each.child} & rigid
        }
    fingers = {each.child for each in joints if each.is_moving and each.parent in rigid}
    for _ in joints:
        fingers |= {each.child for each in joints if not each.is_moving and each.parent in fingers}
    return rigid | fingers
