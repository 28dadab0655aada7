"""A two-armed robot sorts parts of three kinds from a belt into a box. A camera detects the tags of the parts."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from custom_ros_tools.transforms import yaw_of
from robot_model.geometry import Pose
from rpbi_examples.scenes.parts.belt import BELT_X_M, BELT_Z_M, PARTS, RIM_Z_M, Belt, Kind, grasp_yaw, missing, on_belt
from rpbi_examples.scenes.parts.two_arms import Gripper, TwoArms, Zone

from .scene import Scene, Watched

URDF, CHEST = "{rpbi_examples}/robots/nextage_gripper.urdf", Pose((0.0, 0.0, 0.85))
STATION_M, REACH_M = 0.18, 0.32
"""Distances along the belt from its middle [m]: of a part that stops the belt, and of the farthest part in reach."""
MIDDLE_M, LEAST_M = 0.16, 0.05
"""Half the width of the middle zone that one arm at a time may enter, and least distance between the arms [m]."""
HOME_X_M, HOME_Y_M, CARRY_Z_M, HOVER_M = 0.30, 0.25, 1.04, 0.07
"""Waiting position of the hands, outside the camera's view of the belt; height of a hand that carries a part; height of
a hand above its grasp [m].
"""
OPEN_M, SPARE_M, HELD_M = 0.04, 0.012, 0.012
"""Largest opening of a finger, gap between finger and part before a grasp, least opening of a finger that holds a part
[m].
"""
GRASP_RAD, PLACE_RAD, SLOTS_M = -1.0, -math.pi / 2.0, (0.092, 0.03)
"""Preferred yaw of the left hand on the belt, and over the box [rad]; y of the places for parts of the same kind [m].
The right hand has the opposite values.
"""
TRIES, PAUSE_S = 3, 0.3
"""Largest number of tries to take a part, and time without work after which the belt continues [s]."""
SIDES = {"left": 1.0, "right": -1.0}


class Factory(Scene):
    """A two-armed robot sorts parts from a belt into a box. The belt moves on when neither arm can reach a part."""

    world = "{rpbi_examples}/configs/factory/config.yaml"
    watch = Watched(robots=("nextage", "conveyor"), bodies=tuple(PARTS), tags=("tag_detections",))
    of = len(PARTS)
    longest_s = 90.0

    def __init__(self, random: np.random.Generator) -> None:
        super().__init__(random)
        self._arms: TwoArms | None = None
        self._nearest_m = math.inf
        self._busy = dict.fromkeys(SIDES, "")  # the part that each arm works with
        self._middle, self._tries = Zone(), dict.fromkeys(PARTS, 0)
        self._placed: list[tuple[str, Kind]] = []

    def prepare(self) -> None:
        """Puts the parts on the belt in a random order. At first, a housing hides the parts from the camera."""
        for slot, part in enumerate(self.random.permutation(list(PARTS)).tolist()):
            x, y, yaw = self.random.uniform((-0.03, -0.015, -math.pi), (0.03, 0.015, math.pi)).tolist()
            place = (BELT_X_M + x, 0.53 + 0.12 * slot + y, BELT_Z_M + PARTS[part].height_m / 2.0)
            self.place(part, Pose(place, (0.0, 0.0, math.sin(yaw / 2.0), math.cos(yaw / 2.0))))

    def act(self) -> Iterator[None]:
        """Moves the belt and both arms. An arm waits if its next target is too near to the other arm."""
        links = {"left": "LHAND_tip", "right": "RHAND_tip"}
        opened = {"LHAND_JOINT0": OPEN_M, "RHAND_JOINT0": OPEN_M}
        arms = self._arms = TwoArms(self, "nextage", URDF, "CHEST_JOINT0_Link", links, CHEST, opened, LEAST_M)
        belt = Belt(self, "conveyor/target", "belt_joint", way_m=1.1, speed=0.25, acceleration=0.5)
        hands = {side: Gripper(self, "nextage", arms.arms[side], finger) for side, finger in zip(SIDES, opened)}
        works = {side: self._work(side, hand, belt) for side, hand in hands.items()}
        targets, idle_s = {side: next(work) for side, work in works.items()}, 0.0
        while idle_s < 2.0 * PAUSE_S or not (belt.has_ended or len(self._placed) == len(PARTS)):
            for side, work in works.items():
                if arms.send(side, targets[side]):
                    targets[side] = next(work)
            is_idle = not (belt.is_moving or any(self._busy.values()) or any(map(self._reachable, SIDES)))
            idle_s = idle_s + 0.02 if is_idle else 0.0
            belt.is_on = (belt.is_on or idle_s > PAUSE_S) and not self._has_brought()
            belt.act()
            yield

    def note(self) -> None:
        """Records the smallest distance between the arms."""
        if self._arms is not None:
            self._nearest_m = min(self._nearest_m, self._arms.measured_m())

    def has_succeeded(self) -> bool:
        """Returns whether each part is in the compartment of its kind."""
        return not missing(self.seen.poses)

    def score(self) -> tuple[int, int]:
        """Returns the number of parts in the compartment of their kind, and the number of all parts."""
        return self.of - len(missing(self.seen.poses)), self.of

    def fault(self) -> str:
        """Returns a text with the names of the parts that are not in the compartment of their kind."""
        return f"not in the box: {', '.join(missing(self.seen.poses))}"

    def figures(self) -> dict[str, float]:
        """Returns the number of sorted parts, the smallest distance between the arms, and the time per sorted part."""
        time_s, nearest_mm = self.seen.time_s / max(done := self.score()[0], 1), 1e3 * self._nearest_m
        return {"parts placed": done, "time a part [s]": time_s, "smallest distance of the arms [mm]": nearest_mm}

    def _reachable(self, side: str) -> list[str]:
        """Returns the names of the parts that an arm may take, sorted by decreasing distance from the belt's middle."""
        out_m = {part: SIDES[side] * tag.position[1] for part, tag in on_belt(self.sensed.tags).items()}
        mine = [part for part in out_m if 0.0 <= out_m[part] < REACH_M and self._tries[part] < TRIES]
        return sorted((part for part in mine if part not in self._busy.values()), key=lambda part: -out_m[part])

    def _has_brought(self) -> bool:
        """Returns whether the belt has brought parts into reach.

        True if a part is `STATION_M` past the belt's middle. Also true if all remaining parts are on the belt and their
        mean position is past the middle.
        """
        places = [tag.position[1] for tag in on_belt(self.sensed.tags).values()]
        are_last = len(places) + len(self._placed) >= self.of
        return min(places, default=1.0) < -STATION_M or (are_last and sum(places) <= 0.0)

    def _work(self, side: str, hand: Gripper, belt: Belt) -> Iterator[Pose]:
        """Yields the target poses with which a hand takes and sorts one part after the other."""
        while True:
            yield from hand.go((HOME_X_M, SIDES[side] * HOME_Y_M, CARRY_Z_M), 0.0)
            self._middle.leave(side)
            yield from hand.open(OPEN_M, 0.02)
            while not belt.is_moving and (parts := self._reachable(side)):
                self._busy[side] = part = parts[0]
                self._tries[part] += 1
                yield from self._take(side, hand, part)
                if hand.opening() > HELD_M:
                    yield from self._put_down(side, hand, part)
                self._busy[side] = ""

    def _take(self, side: str, hand: Gripper, part: str) -> Iterator[Pose]:
        """Moves a hand above a part, measures the part's pose again, grasps and lifts the part."""
        kind, tag = PARTS[part], on_belt(self.sensed.tags)[part]
        yield from hand.open(kind.half_m + SPARE_M, 0.02)
        is_in_middle = abs(tag.position[1]) < MIDDLE_M
        while is_in_middle and not self._middle.take(side):
            yield hand.target
        for height in (HOVER_M, 0.0):
            tag = on_belt(self.sensed.tags).get(part, tag)
            x, y, _ = tag.position
            yaw = grasp_yaw(kind, yaw_of(tag.quat_xyzw), SIDES[side] * GRASP_RAD)
            yield from hand.go((x, y, BELT_Z_M + kind.height_m / 2.0 + height), yaw)
            if not is_in_middle:
                self._middle.leave(side)
        yield from hand.open(0.0, 0.3)
        yield from hand.go((x, y, CARRY_Z_M), yaw)

    def _put_down(self, side: str, hand: Gripper, part: str) -> Iterator[Pose]:
        """Waits until the middle zone is free, and puts a part into its compartment. Then raises the hand."""
        kind, yaw = PARTS[part], SIDES[side] * PLACE_RAD
        while not self._middle.take(side):
            yield hand.target
        y = SIDES[side] * SLOTS_M[self._placed.count((side, kind)) % len(SLOTS_M)]
        yield from hand.go((kind.x_m, y, CARRY_Z_M), yaw)
        yield from hand.go((kind.x_m, y, RIM_Z_M + 0.01 + kind.height_m / 2.0), yaw)
        yield from hand.open(kind.half_m + SPARE_M, 0.25)
        yield from hand.go((kind.x_m, y, CARRY_Z_M), yaw)
        self._placed.append((side, kind))
