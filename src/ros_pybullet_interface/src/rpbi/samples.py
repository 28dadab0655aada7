"""Samples of sensors: immutable values, all SI units, poses in `rpbi/world` unless noted otherwise."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

from robot_model.geometry import Quaternion, Vector, plus, scaled

from .geometry import Pose, Twist


class JointStateSample(NamedTuple):
    """State of all joints of a robot, fixed ones included, in PyBullet's index order.

    Attributes:
        name: The robot.
        joint_names: n names.
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
    """Poses of a body's links in the world.

    Attributes:
        name: The body.
        frames: n TF frame ids (`rpbi/NAME` or `rpbi/NAME/LINK`).
        poses: n poses of the links' URDF frames, not of their centres of mass.
    """

    name: str
    frames: tuple[str, ...]
    poses: tuple[Pose, ...]


class BaseStateSample(NamedTuple):
    """Pose and velocity of the base of a robot.

    Attributes:
        name: The robot.
        frame: TF frame id of its root link.
        pose: Pose of the root link's URDF frame in the world.
        twist: Velocity of that frame's origin [m/s] and its rotation [rad/s], in the axes of that frame.
    """

    name: str
    frame: str
    pose: Pose
    twist: Twist


class BodyState(NamedTuple):
    """State of a body, as a mirror of the world needs it.

    Attributes:
        name: The body.
        base: Position [m] and quaternion xyzw of the base's inertial frame, as in PyBullet.
        joints: Positions of all joints [rad or m] in index order, of a ball joint its rotation as x, y, z, w.
        nodes: Positions of the simulated corners of a soft body [m]; rigid bodies have none.
    """

    name: str
    base: tuple[float, float, float, float, float, float, float]
    joints: tuple[float | Quaternion, ...]
    nodes: tuple[Vector, ...] = ()


class SceneSample(NamedTuple):
    """The scene of a camera, for the renderer.

    Attributes:
        name: The camera.
        tick: The tick shown.
        stamp_ns: Its stamp [ns].
        camera: Pose of the optical frame (x right, y down, z forward), None as long as it is unknown.
        bodies: State of every body.
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
        frame_id: Frame of the joint's child link, in whose axes the vectors are.
        force: Force [N].
        torque: Moment about the origin of that frame, which is the joint's [N m].
    """

    name: str
    frame_id: str
    force: Vector
    torque: Vector


class ContactPoint(NamedTuple):
    """A point where a body touches another, or one of its links another one.

    Forces are those on the body, as mean over the last tick, or with `average` over all ticks since the last sample.

    Attributes:
        link: The body's link.
        other_body: The body that it touches; the body itself if two of its links touch.
        other_link: Link of the other body.
        position: Position on the surface of the body [m].
        normal: Unit vector of the contact, from the other one towards the body.
        depth: Penetration [m]; negative where force bridges a gap.
        normal_force: Force along the normal [N], not negative.
        friction_directions: Two unit vectors across the normal.
        friction_forces: Forces along these two [N].
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
        """The whole force on the body [N]."""
        first, second = map(scaled, self.friction_forces, self.friction_directions)
        return plus(scaled(self.normal_force, self.normal), plus(first, second))


class ContactsSample:
    """Contact points of a body.

    Attributes:
        name: The body.
    """

    not_in_keyframes = ("_points",)

    def __init__(self, name: str, points: Callable[[], tuple[ContactPoint, ...]]) -> None:
        self.name = name
        self._points = points

    @cached_property
    def points(self) -> tuple[ContactPoint, ...]:
        """All contact points; computed on first use, since many are never used."""
        return self._points()

    def __eq__(self, other: object) -> bool:
        """Whether both are of the same body and have the same points."""
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
        """Sum of the forces of others on the body [N]."""
        total = (0.0, 0.0, 0.0)
        for point in self.points:
            if point.other_body != self.name:
                total = plus(total, point.force)
        return total


def _contacts_of(name: str, points: tuple[ContactPoint, ...]) -> ContactsSample:
    return ContactsSample(name, lambda: points)


class ContactArrowsSample(NamedTuple):
    """Forces on a body as arrows.

    Attributes:
        name: The body.
        arrows: Start and end of each [m].
    """

    name: str
    arrows: tuple[tuple[Vector, Vector], ...]


class SurfaceSample(NamedTuple):
    """The surface of a soft body.

    Attributes:
        name: The body.
        corners: Corners of its triangles, three for each [m].
        rgba: Its colour and opacity, each from 0 to 1.
    """

    name: str
    corners: tuple[Vector, ...]
    rgba: tuple[float, float, float, float]


class ViconSample(NamedTuple):
    """A body as reported by Vicon.

    Attributes:
        name: `BODY/SENSOR`, which are Vicon's subject and segment.
        frame: TF frame that is reported.
        pose: Its pose in the world.
        age_ns: Age of the pose [ns].
    """

    name: str
    frame: str
    pose: Pose
    age_ns: int


class SeenTag(NamedTuple):
    """An AprilTag that a camera sees.

    Attributes:
        id: Its number.
        size: Side of its black square [m].
        pose: Its pose in the camera's optical frame; x to the right, y up, z out of the tag.
    """

    id: int
    size: float
    pose: Pose


class AprilTagsSample(NamedTuple):
    """The AprilTags that a camera sees.

    Attributes:
        name: The sensor.
        frame: TF frame of the camera, an optical one.
        tags: Those that are seen.
        age_ns: Age of the detections [ns].
    """

    name: str
    frame: str
    tags: tuple[SeenTag, ...]
    age_ns: int
