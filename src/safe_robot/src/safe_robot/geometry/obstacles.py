"""Bodies of the environment that a robot must not touch."""

from typing import Any, Literal, NamedTuple

from robot_model.geometry import Pose, Vector

Kind = Literal["box", "sphere", "cylinder", "capsule", "plane", "mesh", "points"]


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
