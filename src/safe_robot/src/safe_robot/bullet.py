"""Distances between collision shapes, measured in a separate PyBullet client.

Meshes are replaced by their convex hulls.
"""

import math
import weakref
from typing import Any

import numpy as np
import pybullet

from custom_ros_tools.transforms import matrix_of
from robot_model.collision.shapes import Obstacle, ObstacleKind
from robot_model.collision.solids import ClosestPoints, Solid, balls_of, box_of, few_balls
from robot_model.geometry import Pose
from robot_model.model import RobotModel
from rpbi.engine.client import Client
from rpbi.urdf.joints import Joint
from rpbi.urdf.loading import load_urdf

OF_PYBULLET: dict[int, ObstacleKind] = {
    pybullet.GEOM_BOX: "box",
    pybullet.GEOM_SPHERE: "sphere",
    pybullet.GEOM_CYLINDER: "cylinder",
    pybullet.GEOM_CAPSULE: "capsule",
    pybullet.GEOM_PLANE: "plane",
    pybullet.GEOM_MESH: "mesh",
}
NO_FILE = ("", "unknown_file")
"""Names that PyBullet reports for a mesh without a file."""
EDGE_M = (math.sqrt(3.0) - 1.0) * 1e-3
"""Largest distance between the corner of a box and PyBullet's corner, which is rounded with a radius of 1 mm [m]."""
EDGED = (pybullet.GEOM_BOX, pybullet.GEOM_CYLINDER)
"""Shapes whose edges and corners PyBullet rounds."""
AABB_MARGIN_M = 6e-3
"""Largest distance by which PyBullet's bounding boxes exceed the shapes in them [m]."""


class BulletShapes:
    """Holds the collision shapes of a robot and of obstacles in PyBullet; implements the protocol `Shapes`.

    Args:
        robot: The robot; its mesh files must exist.

    Attributes:
        links: Names of the links that have a collision shape.

    Raises:
        ConfigError: If the robot cannot be loaded.
    """

    def __init__(self, robot: RobotModel) -> None:
        self._pb = Client(pybullet.DIRECT)
        weakref.finalize(self, self._pb.disconnect)
        self._body = load_urdf(self._pb, robot.urdf_path, {"fileName": robot.urdf_path, "useFixedBase": True})
        joints = Joint.all_of(self._pb, self._body)
        moving = [(joint.index, joint.name) for joint in joints if robot.all_joints[joint.name].is_moving]
        self._moving = [index for index, _ in moving]
        self._to_moving = robot.map_to([name for _, name in moving])
        names = {-1: self._pb.getBodyInfo(self._body)[0].decode(), **{joint.index: joint.link for joint in joints}}
        self._index = {name: i for i, name in names.items() if self._pb.getCollisionShapeData(self._body, i)}
        self.links = tuple(self._index)
        self._missing_m = {link: _missing_m(self._pb, self._body, i) for link, i in self._index.items()}
        self._obstacles: dict[int, int] = {}
        self._missing_of_obstacle: dict[int, float] = {}

    def place(self, q: np.ndarray) -> None:
        """See `Shapes`."""
        self._pb.resetJointStatesMultiDof(self._body, self._moving, self._to_moving(q)[:, None].tolist())

    def put(self, number: int, obstacle: Obstacle) -> None:
        """See `Shapes`."""
        self.remove(number)
        body = self._obstacles[number] = _add(self._pb, obstacle)
        self._missing_of_obstacle[number] = _missing_m(self._pb, body, -1)

    def move(self, number: int, pose: Pose) -> None:
        """See `Shapes`."""
        self._pb.resetBasePositionAndOrientation(self._obstacles[number], *pose)

    def remove(self, number: int) -> None:
        """See `Shapes`."""
        if number in self._obstacles:
            self._pb.removeBody(self._obstacles.pop(number))

    def closest(self, link: str, other: str | int, most_m: float) -> list[ClosestPoints]:
        """See `Shapes`."""
        if isinstance(other, str):
            body, index, missing_m = self._body, self._index[other], self._missing_m[other]
        else:
            body, index, missing_m = self._obstacles[other], -1, self._missing_of_obstacle[other]
        missing_m += self._missing_m[link]
        points: Any = self._pb.getClosestPoints(self._body, body, most_m + missing_m, self._index[link], index)
        return [ClosestPoints(point[8] - missing_m, point[7], point[5], point[6]) for point in points]

    def solids_of(self, link: str) -> list[Solid]:
        """See `Shapes`."""
        index = self._index[link]
        mass = matrix_of(*self._pb.getDynamicsInfo(self._body, index)[3:5])
        return [solid.moved(0, mass) for solid in _solids_of_link(self._pb, self._body, index)]

    def solids_of_obstacle(self, number: int) -> list[Solid]:
        """See `Shapes`."""
        return _solids_of_link(self._pb, self._obstacles[number], -1)

    def radius_m(self, link: str, origin: np.ndarray) -> float:
        """See `Shapes`."""
        lower, upper = self._pb.getAABB(self._body, self._index[link])
        return math.hypot(*np.maximum(np.subtract(upper, origin), np.subtract(origin, lower)))


def _add(pb: Client, obstacle: Obstacle) -> int:
    """Adds an obstacle to PyBullet, and returns the ID of the new body.

    Raises:
        ValueError: If PyBullet cannot represent the obstacle.
    """
    x, y, z = obstacle.size
    options: dict[str, dict[str, Any]] = {
        "box": {"shapeType": pybullet.GEOM_BOX, "halfExtents": (x / 2.0, y / 2.0, z / 2.0)},
        "sphere": {"shapeType": pybullet.GEOM_SPHERE, "radius": max(obstacle.size) / 2.0},
        "cylinder": {"shapeType": pybullet.GEOM_CYLINDER, "radius": max(x, y) / 2.0, "height": z},
        "capsule": {"shapeType": pybullet.GEOM_CAPSULE, "radius": max(x, y) / 2.0, "height": z},
        "plane": {"shapeType": pybullet.GEOM_PLANE, "planeNormal": (0.0, 0.0, 1.0)},
        "mesh": {"shapeType": pybullet.GEOM_MESH, "fileName": obstacle.mesh_file, "meshScale": obstacle.size},
        "points": {"shapeType": pybullet.GEOM_MESH, "vertices": obstacle.corners},
    }
    try:
        shape = pb.createCollisionShape(**options[obstacle.kind])
        body = -1 if shape < 0 else pb.createMultiBody(0.0, shape, -1, *obstacle.pose)
    except pybullet.error:
        body = -1
    if body < 0:
        raise ValueError(f"PyBullet has no {obstacle.kind} for '{obstacle.name}' {obstacle.mesh_file}".rstrip())
    return int(body)


def _solids_of_link(pb: Client, body: int, link: int) -> list[Solid]:
    """Returns the collision shapes of a link, enlarged by `_missing_m`, in the link's inertial frame."""
    return [solid.grown(_missing_m(pb, body, link)) for solid in _shapes_of_link(pb, body, link)]


def _missing_m(pb: Client, body: int, link: int) -> float:
    """Returns the largest distance [m] by which a link's true edges exceed the rounded edges of PyBullet's shapes."""
    return EDGE_M * any(shape[2] in EDGED for shape in pb.getCollisionShapeData(body, link))


def _shapes_of_link(pb: Client, body: int, link: int) -> list[Solid]:
    """Returns the collision shapes of a link in their true size, in the link's inertial frame.

    Returns a single box instead if PyBullet does not report the corners of all shapes, if only some of the shapes are
    meshes from files, or if meshes are rotated relative to each other. This box encloses the link, and is aligned with
    the world's axes in the link's present pose.
    """
    shapes = pb.getCollisionShapeData(body, link)
    if any(shape[2] == pybullet.GEOM_PLANE for shape in shapes):
        return [Solid(0, np.zeros((1, 4)), np.array((0.0, 0.0, 1.0)))]
    state = pb.getLinkState(body, link)[:2] if link >= 0 else pb.getBasePositionAndOrientation(body)
    pose = matrix_of(*state)
    shapes_of_files = [shape for shape in shapes if shape[2] == pybullet.GEOM_MESH and shape[4].decode() not in NO_FILE]
    solids, places = list[Solid](), [matrix_of(*shape[5:7]) for shape in shapes]
    if not shapes_of_files:
        for i, (shape, place) in enumerate(zip(shapes, places)):
            if shape[2] == pybullet.GEOM_MESH:
                solids.append(Solid(0, few_balls(pb.getMeshData(body, link, collisionShapeIndex=i)[1])))
            else:
                solids.append(Solid(0, balls_of(OF_PYBULLET.get(shape[2], ""), shape[3])).moved(0, place))
    elif len(shapes_of_files) == len(shapes):  # PyBullet divides each into several shapes, and does not say which
        solids.append(Solid(0, few_balls(pb.getMeshData(body, link)[1])))
    boxes = [box_of(*each.moved(0, np.linalg.inv(place)).extent).moved(0, place) for each, place in zip(solids, places)]
    lower, upper = pb.getAABB(body, link)
    if boxes and all(np.isfinite(box.balls).all() for box in boxes):
        # PyBullet's box encloses all shapes: it is larger than the reported shapes only if some were not reported
        least, most = box_of(*Solid(0, np.concatenate([box.balls for box in boxes])).extent).moved(0, pose).extent
        if (least - AABB_MARGIN_M <= lower).all() and (most + AABB_MARGIN_M >= upper).all():
            return solids
    return [box_of(np.array(lower), np.array(upper)).moved(0, np.linalg.inv(pose))]
