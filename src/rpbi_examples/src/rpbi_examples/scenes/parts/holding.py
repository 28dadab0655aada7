"""The holders of a thing, from its contacts; whether it is at rest; and a Panda that closes its gripper until
contact.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Collection, Iterator

from custom_ros_tools.transforms import yaw_of
from robot_model.geometry import Pose, Vector, minus, norm, plus
from rpbi_examples.scenes.scene import Scene, SceneFailedError

from .arm import LedArm, about_z, between, smooth

CYCLE_S = 0.02
"""Time of a cycle [s]."""
STILL_S = 0.5
"""Time without motion after which a thing counts as at rest [s]."""
FINGER, FINGER_LINKS = "panda_finger_joint1", {"panda_leftfinger", "panda_rightfinger"}
"""The finger of a Panda that the other one mimics; it is closed at 0. And the links of both fingers."""
APPROACH = Pose(quat_xyzw=(0.0, math.sin(math.radians(-55.0)), 0.0, math.cos(math.radians(-55.0))))
BEFORE = Pose((0.0, 0.0, -0.14))
"""Pose of the gripper at a thing whose x axis points at the robot, 20 deg from above; and before it, relative to
that.
"""
FINGER_SPEED, PRESS_S = 0.04, 0.3
"""Speed of each finger [m/s], and time for which the fingers press before the grasp counts as firm."""


class Holders:
    """Records in every cycle which bodies touch a thing.

    Args:
        scene: The scene that it is in.
        thing: The thing, whose contacts the scene sees.

    Attributes:
        names: Bodies that touch it now.
        all_names: Bodies that have touched it so far.
        alone_s: The longest time for which a body alone touched it [s], by body.
    """

    def __init__(self, scene: Scene, thing: str) -> None:
        self._scene, self._thing = scene, thing
        self.names: frozenset[str] = frozenset()
        self.all_names: set[str] = set()
        self.alone_s: dict[str, float] = {}
        self._since_s = 0.0

    def note(self) -> None:
        """Records the bodies that touch it in this cycle."""
        names = frozenset(touch.other for touch in self._scene.seen.contacts[self._thing])
        if names != self.names:
            self.names, self._since_s = names, self._scene.seen.time_s
        self.all_names |= names
        if len(names) == 1:
            (name,) = names
            self.alone_s[name] = max(self.alone_s.get(name, 0.0), self.has_lasted_s())

    def watch(self, act: Iterator[None], hands: Collection[str]) -> Iterator[None]:
        """Continues an action while only hands touch the thing.

        Raises:
            SceneFailedError: If something else touches it.
        """
        for _ in act:
            if not self.all_names <= set(hands):
                raise SceneFailedError(f"the {self._thing} has fallen")
            yield

    def has_lasted_s(self) -> float:
        """Returns the time for which the same bodies have touched it [s]."""
        return self._scene.seen.time_s - self._since_s

    def is_alone(self, name: str, duration_s: float) -> bool:
        """Returns whether only one body has touched it for a time [s]."""
        return self.names == {name} and self.has_lasted_s() >= duration_s

    def force(self, name: str) -> float:
        """Returns the sum of the normal forces of a body on it [N]."""
        return sum(each.normal_force for each in self._scene.seen.contacts[self._thing] if each.other == name)

    def links(self) -> set[str]:
        """Returns the links of other bodies that touch it."""
        return {touch.other_link for touch in self._scene.seen.contacts[self._thing]}


class RestDetector:
    """Records the positions of a thing in every cycle, and decides whether it is at rest."""

    def __init__(self) -> None:
        self._places: deque[Vector] = deque(maxlen=round(STILL_S / CYCLE_S))

    def note(self, place: Vector) -> None:
        """Records its position [m]."""
        self._places.append(place)

    def is_within(self, way_m: float) -> bool:
        """Returns whether it was within a distance of its present position for `STILL_S`."""
        is_known = len(self._places) == self._places.maxlen
        return is_known and all(norm(minus(self._places[-1], each)) < way_m for each in self._places)


class PandaArm(LedArm):
    """A Panda, moved by the point between its fingers, whose contacts are known.

    Args:
        scene: The scene that it acts in.
        robot: The robot's name in the world.
        base: Pose of its base in the world.
    """

    def __init__(self, scene: Scene, robot: str, base: Pose) -> None:
        super().__init__(scene, robot, "franka_panda/panda.urdf", "panda_link0", "panda_grasptarget", base)

    def follow(self, goal: Callable[[], Pose], duration_s: float) -> Iterator[None]:
        """Moves to a goal that may move meanwhile, as `go` does.

        Raises:
            SceneFailedError: If it is out of reach.
        """
        start, begin_s, share = self.target, self._scene.seen.time_s, 0.0
        while share < 1.0:
            share = (self._scene.seen.time_s - begin_s) / duration_s
            self.send(between(start, goal(), smooth(share)))
            yield

    def opening(self) -> float:
        """Returns the opening of each finger [m]."""
        return self._scene.seen.joints[self._robot][FINGER]

    def close_on(self, holders: Holders) -> Iterator[None]:
        """Closes until both fingers touch a thing, and then presses with all their force.

        Raises:
            SceneFailedError: If there is nothing between them.
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
        """Opens both fingers slowly, so that they push nothing away."""
        target_m = self.opening()
        while target_m < opening_m:
            target_m = min(target_m + FINGER_SPEED * CYCLE_S, opening_m)
            self._send_finger(target_m)
            yield

    def _send_finger(self, target_m: float) -> None:
        self._scene.put(f"{self._robot}/target", {FINGER: target_m})


def above(place: Vector, height_m: float) -> Vector:
    """Returns a place raised by a height [m]."""
    return plus(place, (0.0, 0.0, height_m))


def upright_grasp(thing: Pose, height_m: float) -> Pose:
    """Returns the pose of a gripper at a height above the origin of an upright thing [m], from the side of its x
    axis.
    """
    return Pose(above(thing.position, height_m), about_z(yaw_of(thing.quat_xyzw))) @ APPROACH


def yaw_to(place: Vector, goal: Pose) -> float:
    """Returns the direction from a place to a goal about the vertical [rad]."""
    x, y, _ = minus(goal.position, place)
    return math.atan2(y, x)


def until(condition: Callable[[], bool]) -> Iterator[None]:
    """Waits until a condition holds; used as `yield from until(...)`."""
    while not condition():
        yield
