"""What sensors return: immutable values, all SI units, poses in `rpbi/world` unless said otherwise."""

from __future__ import annotations

from typing import NamedTuple

from .pose import Pose, Vector
from .twist import Twist


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
    """Where the base of a robot is and how it moves.

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
    """Where a body is, as a mirror of the world needs to know it.

    Attributes:
        name: The body.
        base: Position [m] and quaternion xyzw of the base's inertial frame, as PyBullet gives and takes it.
        joints: Positions of all joints [rad or m], in index order.
    """

    name: str
    base: tuple[float, float, float, float, float, float, float]
    joints: tuple[float, ...]


class SceneSample(NamedTuple):
    """All that a camera sees, for the renderer.

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
    """What a force-torque sensor feels.

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
