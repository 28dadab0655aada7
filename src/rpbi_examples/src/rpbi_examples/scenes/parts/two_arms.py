"""Two arms of one robot that keep a distance from each other, a zone that one arm at a time may enter, and grippers."""

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
"""Distances beyond this are not computed [m]."""
DOWN = (0.0, 1.0, 0.0, 0.0)
"""Orientation of a hand at yaw 0: its z points down, its fingers move along y."""


class TwoArms:
    """Moves both arms, and stops one while its next target would be too near to the other arm.

    Args:
        scene: The scene that they act in.
        robot: The robot's name in the world.
        urdf: Its URDF.
        base_link: Link on which both arms are.
        links: By arm, the link that is led.
        base: Pose of the base link in the world.
        joints: Positions of further joints, such as those of fingers, for the distances [rad or m].
        least_m: Least distance between the arms [m].

    Attributes:
        arms: By name.
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
        """Sends an arm to a pose in the world, unless it would be too near to the other arm and not move away from it.

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
        """Returns the present distance between the arms [m]; inf beyond `FAR_M`."""
        return self._distance_m(self._scene.seen.joints[self._robot], FAR_M)

    def _distance_m(self, joints: Mapping[str, float], most_m: float) -> float:
        """Returns the distance with other positions for some joints [m]; inf beyond `most_m`."""
        sent = [position for arm in self.arms.values() for position in arm.positions]
        places = zip(self._names, [*sent, *self._joints.values()])
        self._distances.place(np.array([joints.get(name, position) for name, position in places]))
        return min((self._distances.distance(pair, most_m) for pair in self._pairs), default=math.inf)


class Zone:
    """A zone that one arm at a time may enter."""

    def __init__(self) -> None:
        self._owner = ""

    def take(self, name: str) -> bool:
        """Reserves the zone for an arm if it is free; returns whether the arm may enter."""
        self._owner = self._owner or name
        return self._owner == name

    def leave(self, name: str) -> None:
        """Releases the zone that an arm has left."""
        if self._owner == name:
            self._owner = ""


class Gripper:
    """Yields targets for an arm, and opens and closes its fingers.

    Args:
        scene: The scene that it acts in.
        robot: The robot's name in the world.
        arm: The arm; its link is between the fingers.
        finger: Joint of a finger, which opens from 0 on; the other finger follows it.
        speed: Mean speed of the hand [m/s].
        turn_speed: Mean angular speed [rad/s].
        cycle_s: Time of a cycle [s].
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
        """The last pose that it was sent to, in the world."""
        return self._arm.target

    def opening(self) -> float:
        """Returns the distance of each finger from the closed position [m]."""
        return self._scene.seen.joints[self._robot][self._finger]

    def open(self, way_m: float, duration_s: float) -> Iterator[Pose]:
        """Opens both fingers to a distance [m] and waits; 0 closes them with full force."""
        self._scene.put(f"{self._robot}/target", {self._finger: way_m})
        for _ in range(round(duration_s / self._cycle_s)):
            yield self._arm.target

    def go(self, position: Vector, yaw: float) -> Iterator[Pose]:
        """Moves along a line from rest to rest, until the gripper points down with a position [m] between its
        fingers.
        """
        start, end = self._arm.target, Pose(position, quaternion_product(about_z(yaw), DOWN))
        way_s = norm(minus(end.position, start.position)) / self._speed
        turn_s = angle_between(start.quat_xyzw, end.quat_xyzw) / self._turn_speed
        count = math.ceil(max(way_s, turn_s) / self._cycle_s)
        for index in range(count):
            yield between(start, end, smooth((index + 1) / count))
