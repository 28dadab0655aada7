"""Bodies of a simulated world as obstacles for a guard."""

from collections.abc import Iterator, Set

import pybullet

from custom_ros_tools.errors import ConfigError, Problem, UnknownNameError
from robot_model.collision.shapes import Obstacle
from robot_model.geometry import Pose
from rpbi.bodies import Body
from rpbi.bodies.visual_shapes import turned_to
from rpbi.world import World

from .bullet import NO_FILE, OF_PYBULLET


def obstacles_of_world(path: str, joints: Set[str], robot: str | None = None) -> tuple[Obstacle, ...]:
    """Returns the collision shapes of a world's rigid bodies at the start, in the frame of the robot's root link.

    Args:
        path: The main YAML file of the world.
        joints: Names of the joints of the guarded robot.
        robot: Name of the guarded robot in the world; the robot's own shapes are left out. By default, the only body of
            the world that has these joints. If no body has these joints, the robot's root link is assumed to be at the
            world's origin.

    Raises:
        ConfigError: If the world cannot be loaded, does not have such a robot, or has a shape that `Obstacle` cannot
            describe.
    """
    world = World.from_file(path, connection_mode=pybullet.DIRECT)
    try:
        own = _own_body(world, path, joints, robot)
        base = Pose() if own is None else own.base_pose()
        shapes = [
            shape._replace(pose=base.inverse() @ shape.pose)
            for body in world.bodies.values()
            if body is not own and not body.is_soft
            for shape in shapes_of_body(body, path)
        ]
    finally:
        world.close()
    return tuple(shapes)


def _own_body(world: World, path: str, joints: Set[str], name: str | None) -> Body | None:
    if name is not None:
        if name not in world.bodies:
            raise ConfigError([Problem(path, "", str(UnknownNameError("robot", name, world.bodies)))])
        return world.bodies[name]
    alike = [body for body in world.bodies.values() if not body.is_soft and joints <= _joints_of(body)]
    if len(alike) > 1:
        names = ", ".join(body.name for body in alike)
        message = f"expected the name of one robot, since several have these joints: {names}"
        raise ConfigError([Problem(path, "", message)])
    return alike[0] if alike else None


def _joints_of(body: Body) -> set[str]:
    return {body.pb.getJointInfo(body.body_id, i)[1].decode() for i in range(body.pb.getNumJoints(body.body_id))}


def shapes_of_body(body: Body, path: str) -> Iterator[Obstacle]:
    """Yields the collision shapes of a body in their present poses in the world.

    Args:
        body: A body that is not soft.
        path: Source of the body, for messages.

    Raises:
        ConfigError: If the body has a shape that `Obstacle` cannot describe.
    """
    pb = body.pb
    for link in range(-1, pb.getNumJoints(body.body_id)):
        if link < 0:
            middle = Pose(*pb.getBasePositionAndOrientation(body.body_id))
        else:
            middle = Pose(*pb.getLinkState(body.body_id, link, computeForwardKinematics=1)[:2])
        for _, _, geometry, size, file, position, quat in pb.getCollisionShapeData(body.body_id, link):
            kind = OF_PYBULLET.get(geometry)
            if kind is None or (kind == "mesh" and file.decode() in NO_FILE):
                message = f"'{body.name}' has a shape that a guard cannot take: expected a box, sphere, cylinder, "
                raise ConfigError([Problem(path, "", message + "capsule, plane or mesh of a file, got another")])
            pose = middle @ Pose(position, quat)
            if kind == "sphere":
                size = (2.0 * size[0],) * 3
            elif kind in ("cylinder", "capsule"):
                size = 2.0 * size[1], 2.0 * size[1], size[0]
            elif kind == "plane":
                pose, size = pose @ Pose(quat_xyzw=turned_to(size)), (1.0, 1.0, 1.0)
            yield Obstacle(body.name, kind, tuple(size), pose, file.decode() if kind == "mesh" else "")
