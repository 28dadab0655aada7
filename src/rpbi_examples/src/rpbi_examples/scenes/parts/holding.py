"""Detects which bodies hold a thing and whether the thing is at rest, and moves a Panda that grasps the thing."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Collection, Iterator

from custom_ros_tools.transforms import yaw_of
from robot_model.geometry import Pose, Vector, minus, norm, plus
from rpbi_examples.scenes.scene import Scene, SceneFailedError

from .arm import LedArm, about_z, between, smooth

CYCLE_S = 0.02
"""Duration of a cycle [s]."""
STILL_S = 0.5
"""Time without motion after which a thing counts as at rest [s]."""
FINGER, FINGER_LINKS = "panda_finger_joint1", {"panda_leftfinger", "panda_rightfinger"}
"""The joint of a Panda's finger, which is 0 when closed and which the other finger mimics; and the links of both
fingers.
"""
APPROACH = Pose(quat_xyzw=(0.0, math.sin(math.radians(-55.0)), 0.0, math.cos(math.radians(-55.0))))
BEFORE = Pose((0.0, 0.0, -0.14))
"""`APPROACH` is the gripper's orientation relative to a thing whose x axis points at the robot: the gripper points at
the thing, 20 deg downwards. `BEFORE` is the pose before the grasp, relative to the gripper's pose at the grasp.
"""
FINGER_SPEED, PRESS_S = 0.04, 0.3
"""Speed of each finger [m/s], and time for which the fingers press before the grasp counts as firm [s]."""


class Holders:
    """Records in every cycle which bodies touch a thing.

    Args:
        scene: Scene with the thing. The scene must observe the thing's contacts.
        thing: Name of the thing.

    Attributes:
        names: Names of the bodies that touch the thing now.
        all_names: Names of all bodies that have touched the thing so far.
        alone_s: Longest time for which a body alone touched the thing [s], indexed by the body's name.
    """

    def __init__(self, scene: Scene, thing: str) -> None:
        self._scene, self._thing = scene, thing
        self.names: frozenset[str] = frozenset()
        self.all_names: set[str] = set()
        self.alone_s: dict[str, float] = {}
        self._since_s = 0.0

    def note(self) -> None:
        """Records the bodies that touch the thing in this cycle."""
        names = frozenset(touch.other for touch in self._scene.seen.contacts[self._thing])
        if names != self.names:
            self.names, self._since_s = names, self._scene.seen.time_s
        self.all_names |= names
        if len(names) == 1:
            (name,) = names
            self.alone_s[name] = max(self.alone_s.get(name, 0.0), self.has_lasted_s())

    def watch(self, act: Iterator[None], hands: Collection[str]) -> Iterator[None]:
        """Continues an action as long as only the hands have touched the thing.

        Args:
            act: The action.
            hands: Names of the bodies that may touch the thing.

        Raises:
            SceneFailedError: If another body touches the thing.
        """
        for _ in act:
            if not self.all_names <= set(hands):
                raise SceneFailedError(f"the {self._thing} has fallen")
            yield

    def has_lasted_s(self) -> float:
        """Returns the time since the set of bodies that touch the thing last changed [s]."""
        return self._scene.seen.time_s - self._since_s

    def is_alone(self, name: str, duration_s: float) -> bool:
        """Returns whether only the named body has touched the thing during the last `duration_s` seconds."""
        return self.names == {name} and self.has_lasted_s() >= duration_s

    def force(self, name: str) -> float:
        """Returns the sum of the normal forces between a body and the thing [N]."""
        return sum(each.normal_force for each in self._scene.seen.contacts[self._thing] if each.other == name)

    def links(self) -> set[str]:
        """Returns the names of all links that touch the thing."""
        return {touch.other_link for touch in self._scene.seen.contacts[self._thing]}


class RestDetector:
    """Records the position of a thing in every cycle, and decides whether the thing is at rest."""

    def __init__(self) -> None:
        self._places: deque[Vector] = deque(maxlen=round(STILL_S / CYCLE_S))

    def note(self, place: Vector) -> None:
        """Records the thing's position in this cycle [m]."""
        self._places.append(place)

    def is_within(self, way_m: float) -> bool:
        """Returns whether the thing stayed within a distance [m] of its present position for `STILL_S`."""
        is_known = len(self._places) == self._places.maxlen
        return is_known and all(norm(minus(self._places[-1], each)) < way_m for each in self._places)


class PandaArm(LedArm):
    """Moves a Panda's arm and gripper. All poses are poses of the point between the fingers.

    Args:
        scene: Scene in which the robot acts.
        robot: Name of the robot in the world.
        base: Pose of the robot's base in the world.
    """

    def __init__(self, scene: Scene, robot: str, base: Pose) -> None:
        super().__init__(scene, robot, "franka_panda/panda.urdf", "panda_link0", "panda_grasptarget", base)

    def follow(self, goal: Callable[[], Pose], duration_s: float) -> Iterator[None]:
        """Moves the gripper to a goal that may move, from rest to rest.

        Args:
            goal: Returns the present goal pose in the world.
            duration_s: Duration of the motion [s].

        Raises:
            SceneFailedError: If a pose on the path is out of reach.
        """
        start, begin_s, share = self.target, self._scene.seen.time_s, 0.0
        while share < 1.0:
            share = (self._scene.seen.time_s - begin_s) / duration_s
            self.send(between(start, goal(), smooth(share)))
            yield

    def opening(self) -> float:
        """Returns the distance of each finger from its closed position [m]."""
        return self._scene.seen.joints[self._robot][FINGER]

    def close_on(self, holders: Holders) -> Iterator[None]:
        """Closes the gripper until both fingers touch a thing, and then presses with full force for `PRESS_S`.

        Args:
            holders: Record of the bodies that touch the thing.

        Raises:
            SceneFailedError: If the gripper is fully closed before both fingers touch the thing.
        """
        target_m = self.opening()
        while not FINGER_LINKS <= holders.links():
            target_m -= FINGER_SPEED * CYCLE_S
            if target_m < 0.0:
                raise SceneFailedError(f"{self._robot}: expected both fingers at the thing, got a closed gripper")
            self._send_finger(target_m)
            yield
        self._send_finger(0.0)
        yield from self._scene.wait(PRESS_S)

    def open(self, opening_m: float) -> Iterator[None]:
        """Opens both fingers to an opening [m], slowly, so that the fingers do not push things away."""
        target_m = self.opening()
        while target_m < opening_m:
            target_m = min(target_m + FINGER_SPEED * CYCLE_S, opening_m)
            self._send_finger(target_m)
            yield

    def _send_finger(self, target_m: float) -> None:
        self._scene.put(f"{self._robot}/target", {FINGER: target_m})


def above(place: Vector, height_m: float) -> Vector:
    """Returns the position at a height above `place` [m]."""
    return plus(place, (0.0, 0.0, height_m))


def upright_grasp(thing: Pose, height_m: float) -> Pose:
    """Returns the gripper's pose for the grasp of an upright thing, from the side to which the thing's x axis points.

    Args:
        thing: Pose of the thing in the world.
        height_m: Height of the grasp above the thing's origin [m].
    """
    return Pose(above(thing.position, height_m), about_z(yaw_of(thing.quat_xyzw))) @ APPROACH


def yaw_to(place: Vector, goal: Pose) -> float:
    """Returns the horizontal direction from a position to a goal, as a yaw angle [rad]."""
    x, y, _ = minus(goal.position, place)
    return math.atan2(y, x)


def until(condition: Callable[[], bool]) -> Iterator[None]:
    """Waits until a condition holds. Use: `yield from until(...)`."""
    while not condition():
        yield
