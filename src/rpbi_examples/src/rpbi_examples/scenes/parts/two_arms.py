"""Moves two arms of a robot and keeps the arms apart, reserves a zone for one arm at a time, and moves grippers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from custom_ros_tools.config import replace_package
from robot_model.geometry import Pose, Vector, angle_between, minus, norm, quaternion_product
from robot_model.model import RobotModel
from rpbi_examples.scenes.scene import Scene
from safe_robot.checks.proximity_check import link_distances

from .arm import LedArm, about_z, between, smooth

FAR_M = 0.5
"""Largest distance that `measured_m` computes [m]."""
DOWN = (0.0, 1.0, 0.0, 0.0)
"""Orientation of a hand at yaw 0: the hand's z axis points down, and the fingers move along y."""


class TwoArms:
    """Moves both arms of a robot, and rejects targets at which one arm would be too near to the other.

    Args:
        scene: Scene in which the robot acts.
        robot: Name of the robot in the world.
        urdf: URDF file of the robot.
        base_link: Link on which both arms are mounted.
        links: For each arm, the link that is moved, indexed by the arm's name.
        base: Pose of `base_link` in the world.
        joints: Fixed positions of other joints, such as fingers, for the computation of distances [rad or m].
        least_m: Minimum distance between the arms [m].

    Attributes:
        arms: The arms, indexed by name.
    """

    def __init__(
        self,
        scene: Scene,
        robot: str,
        urdf: str,
        base_link: str,
        links: Mapping[str, str],
        base: Pose,
        joints: Mapping[str, float],
        least_m: float,
    ) -> None:
        self._scene, self._robot, self._least_m, self._joints = scene, robot, least_m, dict(joints)
        self.arms = {name: LedArm(scene, robot, urdf, base_link, link, base) for name, link in links.items()}
        self._names = [*(joint for arm in self.arms.values() for joint in arm.joint_names), *joints]
        guarded = RobotModel(replace_package(urdf), self._names)
        self._distances = link_distances(guarded)
        chains = {link: {joint.name for joint in guarded.chain(link)} for link in self._distances.links}
        first, second = (
            [link for link, chain in chains.items() if arm.joint_names[0] in chain] for arm in self.arms.values()
        )
        self._pairs = [(a, b) for a in first for b in second]
        self._sent_m = self._distance_m({}, least_m)

    def send(self, name: str, pose: Pose) -> bool:
        """Sends an arm to a pose in the world, unless the pose is too near to the other arm.

        If the arms are already nearer than the minimum distance, a pose that keeps or increases the distance is
        accepted.

        Returns:
            Whether the arm was sent.

        Raises:
            SceneFailedError: If the pose is out of reach.
        """
        arm = self.arms[name]
        if pose == arm.target:
            return True
        there = dict(zip(arm.joint_names, arm.positions_at(pose)))
        distance_m = self._distance_m(there, self._least_m)
        if distance_m < min(self._least_m, self._sent_m):
            return False
        self._sent_m = distance_m
        arm.send(pose)
        return True

    def measured_m(self) -> float:
        """Returns the present distance between the arms [m], or inf if larger than `FAR_M`."""
        return self._distance_m(self._scene.seen.joints[self._robot], FAR_M)

    def _distance_m(self, joints: Mapping[str, float], most_m: float) -> float:
        """Returns the distance between the arms at given joint positions [m], or inf if larger than `most_m`.

        Args:
            joints: Positions of some joints [rad or m]. Other joints are at their last targets.
            most_m: Distance above which the result is inf [m].
        """
        sent = [position for arm in self.arms.values() for position in arm.positions]
        places = zip(self._names, [*sent, *self._joints.values()])
        self._distances.place(np.array([joints.get(name, position) for name, position in places]))
        return min((self._distances.distance(pair, most_m) for pair in self._pairs), default=math.inf)


class Zone:
    """A zone that one arm at a time may enter."""

    def __init__(self) -> None:
        self._owner = ""

    def take(self, name: str) -> bool:
        """Reserves the zone for an arm if the zone is free, and returns whether the arm may enter."""
        self._owner = self._owner or name
        return self._owner == name

    def leave(self, name: str) -> None:
        """Releases the zone if the named arm has reserved it."""
        if self._owner == name:
            self._owner = ""


class Gripper:
    """Yields target poses for an arm with a gripper, and opens and closes the gripper's fingers.

    The caller must send the target poses to the arm, one in each cycle.

    Args:
        scene: Scene in which the robot acts.
        robot: Name of the robot in the world.
        arm: The arm. The origin of the arm's moved link is between the fingers.
        finger: Joint of a finger, which is 0 when closed. The other finger mimics this joint.
        speed: Largest mean speed of the hand [m/s].
        turn_speed: Largest mean angular speed of the hand [rad/s].
        cycle_s: Duration of a cycle [s].
    """

    def __init__(
        self,
        scene: Scene,
        robot: str,
        arm: LedArm,
        finger: str,
        speed: float = 0.4,
        turn_speed: float = 2.5,
        cycle_s: float = 0.02,
    ) -> None:
        self._scene, self._robot, self._arm, self._finger = scene, robot, arm, finger
        self._speed, self._turn_speed, self._cycle_s = speed, turn_speed, cycle_s

    @property
    def target(self) -> Pose:
        """Last target pose that was sent to the arm, in the world."""
        return self._arm.target

    def opening(self) -> float:
        """Returns the distance of each finger from the closed position [m]."""
        return self._scene.seen.joints[self._robot][self._finger]

    def open(self, way_m: float, duration_s: float) -> Iterator[Pose]:
        """Sends both fingers to the distance `way_m` from the closed position [m]; with 0, the gripper closes with full
        force. Then yields the arm's last target for `duration_s` [s].
        """
        self._scene.put(f"{self._robot}/target", {self._finger: way_m})
        for _ in range(round(duration_s / self._cycle_s)):
            yield self._arm.target

    def go(self, position: Vector, yaw: float) -> Iterator[Pose]:
        """Yields target poses along a line, from rest to rest.

        Args:
            position: Final position of the point between the fingers, in the world [m].
            yaw: Final yaw of the gripper, which points down [rad].
        """
        start, end = self._arm.target, Pose(position, quaternion_product(about_z(yaw), DOWN))
        way_s = norm(minus(end.position, start.position)) / self._speed
        turn_s = angle_between(start.quat_xyzw, end.quat_xyzw) / self._turn_speed
        count = math.ceil(max(way_s, turn_s) / self._cycle_s)
        for index in range(count):
            yield between(start, end, smooth((index + 1) / count))
