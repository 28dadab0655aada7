"""Bodies of the environment: what a robot may not touch."""

from collections.abc import Iterator, Set
from typing import Any, Literal, NamedTuple

import pybullet

from custom_ros_tools.errors import ConfigError, Problem, UnknownNameError
from rpbi.bodies import Body
from rpbi.bodies.visual_shapes import turned_to
from rpbi.engine.client import Client
from rpbi.geometry import Pose, Vector
from rpbi.urdf.joints import Joint
from rpbi.world import World

Kind = Literal["box", "sphere", "cylinder", "capsule", "plane", "mesh", "points"]
OF_PYBULLET: dict[int, Kind] = {
    pybullet.GEOM_BOX: "box",
    pybullet.GEOM_SPHERE: "sphere",
    pybullet.GEOM_CYLINDER: "cylinder",
    pybullet.GEOM_CAPSULE: "capsule",
    pybullet.GEOM_PLANE: "plane",
    pybullet.GEOM_MESH: "mesh",
}
NO_FILE = ("", "unknown_file")
"""What PyBullet says of a mesh that comes from no file."""


class Obstacle(NamedTuple):
    """A convex shape of the environment.

    Attributes:
        name: Its name, for messages; shapes of one body may share it.
        kind: What it is; a cylinder or capsule stands along z, a plane has all below z = 0 in it, a mesh and points
            stand for their convex hull.
        size: Extents along x, y and z, as a marker's scale [m]: a capsule's z without its round ends; a mesh's factors.
        pose: Where it is in the robot's root.
        mesh_file: File of a mesh.
        corners: Points of which the hull is taken [m].
    """

    name: str
    kind: Kind
    size: Vector
    pose: Pose = Pose()
    mesh_file: str = ""
    corners: tuple[Vector, ...] = ()

    @property
    def shape(self) -> tuple[Any, ...]:
        """All but name and place."""
        return self.kind, self.size, self.mesh_file, self.corners

    def add_to(self, pb: Client) -> int:
        """Adds it to a PyBullet client, and returns its number there.

        Raises:
            ValueError: If PyBullet refuses.
        """
        x, y, z = self.size
        options: dict[str, dict[str, Any]] = {
            "box": {"shapeType": pybullet.GEOM_BOX, "halfExtents": (x / 2.0, y / 2.0, z / 2.0)},
            "sphere": {"shapeType": pybullet.GEOM_SPHERE, "radius": max(self.size) / 2.0},
            "cylinder": {"shapeType": pybullet.GEOM_CYLINDER, "radius": max(x, y) / 2.0, "height": z},
            "capsule": {"shapeType": pybullet.GEOM_CAPSULE, "radius": max(x, y) / 2.0, "height": z},
            "plane": {"shapeType": pybullet.GEOM_PLANE, "planeNormal": (0.0, 0.0, 1.0)},
            "mesh": {"shapeType": pybullet.GEOM_MESH, "fileName": self.mesh_file, "meshScale": self.size},
            "points": {"shapeType": pybullet.GEOM_MESH, "vertices": self.corners},
        }
        try:
            shape = pb.createCollisionShape(**options[self.kind])
            body = -1 if shape < 0 else pb.createMultiBody(0.0, shape, -1, *self.pose)
        except pybullet.error:
            body = -1
        if body < 0:
            raise ValueError(f"PyBullet has no {self.kind} for '{self.name}' {self.mesh_file}".rstrip())
        return int(body)


def obstacles_of_world(path: str, joints: Set[str], robot: str | None = None) -> tuple[Obstacle, ...]:
    """Returns the collision shapes of a world, where they are at its start, in the root of one of its robots.

    Args:
        path: The main YAML file of the world.
        joints: Names of the joints of the guarded robot.
        robot: Its name in the world, where it is left out. Without it, it is the only body of the world that has these
            joints; if there is none, the world's origin is the robot's root.

    Raises:
        ConfigError: If the world cannot be loaded, has no such robot, or a shape that cannot be taken.
    """
    world = World.from_file(path, connection_mode=pybullet.DIRECT)
    try:
        own = _own_body(world, path, joints, robot)
        base = Pose() if own is None else own.base_pose()
        shapes = [
            shape._replace(pose=base.inverse() @ shape.pose)
            for body in world.bodies.values()
            if body is not own and not body.is_soft
            for shape in _shapes_of(body, path)
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
    return {joint.name for joint in Joint.all_of(body.pb, body.body_id)}


def _shapes_of(body: Body, path: str) -> Iterator[Obstacle]:
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
