"""Sensor samples: immutable values in SI units. Poses are in the frame `rpbi/world` unless noted otherwise."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

from robot_model.geometry import Quaternion, Vector, plus, scaled

from .geometry import Pose, Twist


class JointStateSample(NamedTuple):
    """State of all joints of a robot, including fixed joints, in PyBullet's index order.

    Attributes:
        name: Name of the robot.
        joint_names: n joint names.
        position: n positions [rad or m].
        velocity: n velocities [rad/s or m/s].
        effort: n torques or forces [N m or N] that the motors applied in the last tick.
    """

    name: str
    joint_names: tuple[str, ...]
    position: tuple[float, ...]
    velocity: tuple[float, ...]
    effort: tuple[float, ...]


class LinkPoseSample(NamedTuple):
    """Poses of a body's links in the world frame.

    Attributes:
        name: Name of the body.
        frames: n TF frame ids of the links (`rpbi/NAME` or `rpbi/NAME/LINK`).
        poses: n poses of the links' URDF frames, not of the links' centres of mass.
    """

    name: str
    frames: tuple[str, ...]
    poses: tuple[Pose, ...]


class BaseStateSample(NamedTuple):
    """Pose and velocity of a body's root link.

    Attributes:
        name: Name of the body.
        frame: TF frame id of the root link.
        pose: Pose of the root link's URDF frame in the world frame.
        twist: Linear [m/s] and angular velocity [rad/s] of the root link's URDF frame, in the frame's own axes.
    """

    name: str
    frame: str
    pose: Pose
    twist: Twist


class BodyState(NamedTuple):
    """State that is needed to place a body in a copy of the world.

    Attributes:
        name: Name of the body.
        base: Position [m] and quaternion x, y, z, w of the base's inertial frame, as in PyBullet.
        joints: Positions of all joints [rad or m] in index order; for a ball joint a quaternion x, y, z, w.
        nodes: Positions [m] of the simulated mesh nodes of a soft body; empty for a rigid body.
    """

    name: str
    base: tuple[float, float, float, float, float, float, float]
    joints: tuple[float | Quaternion, ...]
    nodes: tuple[Vector, ...] = ()


class SceneSample(NamedTuple):
    """The scene that the renderer draws for a camera.

    Attributes:
        name: Name of the camera.
        tick: Tick of the scene.
        stamp_ns: Stamp of the tick [ns].
        camera: Pose of the camera's optical frame (x right, y down, z forward); None if unknown.
        bodies: State of every body in the world.
    """

    name: str
    tick: int
    stamp_ns: int
    camera: Pose | None
    bodies: tuple[BodyState, ...]


class WrenchSample(NamedTuple):
    """Measurement of a force-torque sensor.

    Attributes:
        name: `ROBOT/JOINT`.
        frame_id: TF frame of the joint's child link. Force and torque are in the axes of this frame.
        force: Force [N].
        torque: Moment [N m] about the origin of the frame, where the joint is.
    """

    name: str
    frame_id: str
    force: Vector
    torque: Vector


class ContactPoint(NamedTuple):
    """A contact point of a body with another body, or between two links of the body.

    Forces act on the body. They are means over the last tick, or over all ticks since the last sample if YAML sets
    `average`.

    Attributes:
        link: Link of the body.
        other_body: Name of the other body; name of the body itself if two of its links touch.
        other_link: Link of the other body.
        position: Position [m] of the contact on the surface of the body.
        normal: Contact normal, a unit vector from the other body towards the body.
        depth: Penetration depth [m]; negative if a contact force acts across a gap.
        normal_force: Force along the normal [N], not negative.
        friction_directions: Two unit vectors perpendicular to the normal.
        friction_forces: Forces along the two friction directions [N].
    """

    link: str
    other_body: str
    other_link: str
    position: Vector
    normal: Vector
    depth: float
    normal_force: float
    friction_directions: tuple[Vector, Vector]
    friction_forces: tuple[float, float]

    @property
    def force(self) -> Vector:
        """Total force [N] of the contact on the body: normal force plus friction."""
        first, second = map(scaled, self.friction_forces, self.friction_directions)
        return plus(scaled(self.normal_force, self.normal), plus(first, second))


class ContactsSample:
    """Contact points of a body.

    Args:
        name: Name of the body.
        points: Function that computes the contact points.
    """

    not_in_keyframes = ("_points",)

    def __init__(self, name: str, points: Callable[[], tuple[ContactPoint, ...]]) -> None:
        self.name = name
        self._points = points

    @cached_property
    def points(self) -> tuple[ContactPoint, ...]:
        """All contact points. They are computed at the first access, since most samples are never used."""
        return self._points()

    def __eq__(self, other: object) -> bool:
        """Returns whether both samples have the same body and the same points."""
        return isinstance(other, ContactsSample) and (self.name, self.points) == (other.name, other.points)

    def __hash__(self) -> int:
        return hash((self.name, self.points))

    def __reduce__(self) -> tuple[Callable[..., ContactsSample], tuple[Any, ...]]:
        """Pickles the points, not the object that computes them."""
        return _contacts_of, (self.name, self.points)

    def __repr__(self) -> str:
        return f"ContactsSample(name={self.name!r}, points={self.points!r})"

    @property
    def force(self) -> Vector:
        """Sum [N] of the contact forces that other bodies exert on the body."""
        total = (0.0, 0.0, 0.0)
        for point in self.points:
            if point.other_body != self.name:
                total = plus(total, point.force)
        return total


def _contacts_of(name: str, points: tuple[ContactPoint, ...]) -> ContactsSample:
    return ContactsSample(name, lambda: points)


class ContactArrowsSample(NamedTuple):
    """Contact forces on a body as arrows for RViz.

    Attributes:
        name: Name of the body.
        arrows: Start point and end point of each arrow [m].
    """

    name: str
    arrows: tuple[tuple[Vector, Vector], ...]


class SurfaceSample(NamedTuple):
    """The surface of a soft body.

    Attributes:
        name: Name of the body.
        corners: Corners of the surface's triangles [m]; three consecutive corners are one triangle.
        rgba: Colour and opacity of the surface, each from 0 to 1.
    """

    name: str
    corners: tuple[Vector, ...]
    rgba: tuple[float, float, float, float]


class ViconSample(NamedTuple):
    """Pose of a body as Vicon, a motion capture system, reports it.

    Attributes:
        name: `BODY/SENSOR`. BODY is Vicon's subject, SENSOR is Vicon's segment.
        frame: TF frame of the reported pose.
        pose: Pose of the frame in the world frame.
        age_ns: Age of the pose [ns].
    """

    name: str
    frame: str
    pose: Pose
    age_ns: int


class SeenTag(NamedTuple):
    """An AprilTag that a camera sees.

    Attributes:
        id: Number of the tag.
        size: Edge length of the tag's black square [m].
        pose: Pose of the tag in the camera's optical frame. The tag's x axis points to the right, y up, z out of the
            tag.
    """

    id: int
    size: float
    pose: Pose


class AprilTagsSample(NamedTuple):
    """The AprilTags that a camera sees.

    Attributes:
        name: Name of the sensor.
        frame: TF frame of the camera, an optical frame.
        tags: The tags.
        age_ns: Age of the detections [ns].
    """

    name: str
    frame: str
    tags: tuple[SeenTag, ...]
    age_ns: int
