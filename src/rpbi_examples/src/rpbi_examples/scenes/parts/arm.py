"""Moves a link of an arm along lines."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from custom_ros_tools.transforms import finite_vector
from ik_ros.problem import IKProblem
from ik_ros.solvers.kdl import KdlConfig, KdlSolver
from robot_model.geometry import (
    Pose,
    Quaternion,
    minus,
    plus,
    quaternion_of,
    quaternion_product,
    rotated,
    rotation_between,
    scaled,
)
from rpbi_examples.scenes.scene import Scene, SceneFailedError


class LedArm:
    """Moves a link of a robot with joint targets from inverse kinematics. Each motion starts at the last target.

    Args:
        scene: Scene in which the arm acts.
        robot: Name of the robot in the world.
        urdf: URDF file of the robot.
        base_link: First link of the kinematic chain.
        link: Last link of the kinematic chain, which is moved.
        base: Pose of `base_link` in the world.
        slot: Input of the world for the joint targets. Default: `ROBOT/target`.

    Attributes:
        joint_names: Names of the joints in the chain.
        target: Last target pose of the link, in the world.
    """

    def __init__(
        self, scene: Scene, robot: str, urdf: str, base_link: str, link: str, base: Pose = Pose(), slot: str = ""
    ) -> None:
        self._scene, self._robot, self._slot, self._base = scene, robot, slot or f"{robot}/target", base
        config = {"urdf_filename": urdf, "base_link": base_link, "tip_link": link}
        self._solver = KdlSolver(KdlConfig.parse(config, f"arm of {robot}"))
        self.joint_names = self._solver.joint_names
        joints = scene.seen.joints[robot]
        self._positions = [joints[name] for name in self.joint_names]
        self.target = self.pose()

    def pose(self) -> Pose:
        """Returns the present pose of the link in the world."""
        joints = self._scene.seen.joints[self._robot]
        return self._base @ self._solver.chain.pose([joints[name] for name in self.joint_names])

    @property
    def positions(self) -> list[float]:
        """Last target positions of the joints [rad or m]."""
        return list(self._positions)

    def positions_at(self, pose: Pose) -> list[float]:
        """Returns joint positions [rad or m] that bring the link to a world pose. Searches from the last targets.

        Raises:
            SceneFailedError: If the pose is out of reach.
        """
        start = dict(zip(self.joint_names, self._positions))
        found = self._solver.solve(IKProblem(self._base.inverse() @ pose, start=start))
        if not found.success:
            place = ", ".join(f"{each:.3f}" for each in pose.position)
            raise SceneFailedError(f"{self._robot}: ({place}) m is out of reach: {found.message}")
        return list(found.positions)

    def send(self, pose: Pose) -> None:
        """Sends the link to a pose in the world, which must be near the last target.

        Raises:
            SceneFailedError: If the pose is out of reach.
        """
        self._positions = self.positions_at(pose)
        self.target = pose
        self._scene.put(self._slot, dict(zip(self.joint_names, self._positions)))

    def go(self, pose: Pose, duration_s: float) -> Iterator[None]:
        """Moves the link along a line to a pose in the world, from rest to rest. Use: `yield from arm.go(...)`."""
        start, begin_s = self.target, self._scene.seen.time_s
        while (share := (self._scene.seen.time_s - begin_s) / duration_s) < 1.0:
            self.send(between(start, pose, smooth(share)))
            yield
        self.send(pose)
        yield

    def move_joints(self, positions: Sequence[float], duration_s: float) -> Iterator[None]:
        """Moves the joints of the arm to target positions [rad or m], from rest to rest."""
        goal = finite_vector(positions, len(self.joint_names), "positions").tolist()
        start, begin_s = list(self._positions), self._scene.seen.time_s
        share = 0.0
        while share < 1.0:
            share = min((self._scene.seen.time_s - begin_s) / duration_s, 1.0)
            self._positions = [a + smooth(share) * (b - a) for a, b in zip(start, goal)]
            self._scene.put(self._slot, dict(zip(self.joint_names, self._positions)))
            yield
        self.target = self._base @ self._solver.chain.pose(self._positions)


def smooth(share: float) -> float:
    """Returns the covered share of a distance for an elapsed share of the time, for a motion from rest to rest.

    The polynomial has degree 5: T. Flash, N. Hogan, The coordination of arm movements, J. Neuroscience 5(7), 1985.
    """
    share = min(max(share, 0.0), 1.0)
    return share**3 * (10.0 - 15.0 * share + 6.0 * share**2)


def between(start: Pose, end: Pose, share: float) -> Pose:
    """Interpolates two poses: the position along a line, the orientation along the shortest rotation.

    Args:
        start: Pose at the share 0.
        end: Pose at the share 1.
        share: Share of the distance and of the rotation.
    """
    position = plus(start.position, scaled(share, minus(end.position, start.position)))
    turn = quaternion_of(scaled(share, rotation_between(start.quat_xyzw, end.quat_xyzw)))
    return Pose(position, quaternion_product(turn, start.quat_xyzw))


def about_z(yaw: float) -> Quaternion:
    """Returns the quaternion of a rotation about the vertical by an angle [rad]."""
    return 0.0, 0.0, math.sin(yaw / 2.0), math.cos(yaw / 2.0)


def tilt_deg(pose: Pose) -> float:
    """Returns the angle between the z axis of a pose and the vertical [deg]."""
    return math.degrees(math.acos(min(rotated(pose.quat_xyzw, (0.0, 0.0, 1.0))[2], 1.0)))
