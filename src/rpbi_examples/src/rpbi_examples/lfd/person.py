"""A simulated person who pushes a box to a goal with the four arrow keys. The person sees the box and the arm's tip."""

from __future__ import annotations

import math
from enum import Enum
from typing import NamedTuple

import numpy as np

from rpbi_examples.motions import PlanarPose

Place = tuple[float, float]

HALF_SIDE_M, TIP_RADIUS_M = 0.1, 0.015
"""Half of the box's side length, and radius of the ball at the arm's tip [m]."""
CLEARANCE_M = 0.035
"""Distance of the tip from the box while the tip moves around the box [m]."""
ALIGNED_M, PASSED_M = 0.003, 0.015
"""Distance from the end of a leg at which the leg is complete [m]: the last leg before a push, and other legs."""
CLOSE_M, CLOSE_RAD = 0.02, math.radians(5.0)
"""Distance [m] and angle [rad] of the box from its goal at which the person stops pushing."""
TURNED_RAD = math.radians(8.0)
"""Increase of the box's angle during a push at which the person ends the push and chooses another one [rad]."""
REACTION_S = 0.08
"""Time between the observation that ends a push and the stop of the tip [s]."""
TURN_ARM_M2 = 0.006
"""Product of lever arm and length of a push that turns the box by 1 rad [m2]."""
MAX_ASIDE_M = 0.05
"""Largest lever arm of a push: its distance from the middle of the box's side [m]."""
STILL_SPEED, STILL_S = 0.005, 0.2
"""Speed below which the tip counts as at rest [m/s], and time for which the tip must be at rest [s]."""
HERE_M, MIN_PUSH_M = 0.02, 0.02
"""Two lengths [m]. The first is a bonus for a push along the axis on which the tip already is, since the tip need not
move around the box. The second is the least length of a push in the computation of the lever arm.
"""
PUSHED_M, PRESS_SHARE = 0.006, 0.75
"""Distance from the goal at which a push is over [m], and share of the remaining distance covered by one key press."""
MAX_PUSHES, MAX_PRESSES = 10, 8
"""Largest number of pushes, and largest number of key presses for one leg. The person gives up afterwards."""
MAX_AIM_ERROR_M = 0.002
"""Largest random sideways error of the point at which the person pushes [m]."""
LOST_M = 0.5
"""Distance of the box from its goal at which the person gives up [m]."""


class Direction(Enum):
    """Arrow keys. The value of a key is the tip's direction of motion: x to the right, y away from the person."""

    RIGHT = (1, 0)
    UP = (0, 1)
    LEFT = (-1, 0)
    DOWN = (0, -1)

    @property
    def axis(self) -> int:
        """Index of the coordinate that changes: 0 for x, 1 for y."""
        return 0 if self.value[0] else 1

    @property
    def sign(self) -> int:
        """Sign of the motion along `axis`: 1 or -1."""
        return sum(self.value)

    @classmethod
    def along(cls, axis: int, sign: float) -> Direction:
        """Returns the direction along an axis (0 or 1) in which the coordinate changes with the given sign."""
        return next(each for each in cls if each.axis == axis and each.sign * sign > 0.0)


ROUND = (Direction.RIGHT, Direction.UP, Direction.LEFT, Direction.DOWN)
"""The sides of the box, counter-clockwise as seen from above."""


class _Leg(NamedTuple):
    """Part of the path around the box, along x or y. The leg ends when the tip's coordinate `axis` is near `value`.

    Attributes:
        axis: Index of the coordinate that changes: 0 for x, 1 for y.
        value: Value of the coordinate at the end of the leg [m].
        tolerance: Largest distance from `value` at which the leg is complete [m].
    """

    axis: int
    value: float
    tolerance: float


class Person:
    """Decides which arrow key is held. Positions are in the person's frame: x to the right, y away from the person.

    Each push is along x or y, and starts near the middle of the box's rear side. If the box has turned, the person
    pushes beside the middle to turn the box back. Before a push, the person moves the tip around the box. When the tip
    is at rest, the person chooses the next key press from the present positions of box and tip.

    Args:
        goal: Goal pose of the box.
        speed: Speed of the tip while a key is held [m/s].
        random: Random generator for small errors of the aim.

    Attributes:
        is_done: True if the box is at its goal, or if the person has given up.
    """

    def __init__(self, goal: PlanarPose, speed: float, random: np.random.Generator) -> None:
        self._goal, self._speed, self._random = goal, speed, random
        self._way: list[_Leg] = []
        self._push: Direction | None = None
        self._max_turn_rad = TURNED_RAD
        self._is_pushing = False
        self._pushes = self._presses = 0
        self._held: tuple[Direction, float] | None = None
        self._last: tuple[float, Place] = (-math.inf, (0.0, 0.0))
        self._moved_s = -math.inf
        self.is_done = False

    def key(self, time_s: float, tip: Place, box: PlanarPose) -> Direction | None:
        """Processes an observation, and returns the arrow key to hold now. None: all keys are released.

        Args:
            time_s: Time of the observation [s].
            tip: Position of the tip [m].
            box: Pose of the box.
        """
        (last_s, last_tip), self._last = self._last, (time_s, tip)
        dt_s = time_s - last_s
        velocity = [(now - then) / dt_s for now, then in zip(tip, last_tip)] if 0.0 < dt_s < math.inf else [0.0, 0.0]
        if max(map(abs, velocity)) > STILL_SPEED:
            self._moved_s = time_s
        if self._held is not None:
            is_pushed = self._is_pushing and self._is_pushed(tip, velocity, box)
            if time_s >= self._held[1] or is_pushed:
                self._held, self._moved_s = None, time_s
        elif time_s - self._moved_s >= STILL_S and not self.is_done:
            self._held = self._next(time_s, tip, box)
        return None if self._held is None else self._held[0]

    def _next(self, time_s: float, tip: Place, box: PlanarPose) -> tuple[Direction, float] | None:
        """Chooses the next key press: returns the key and the time of its release [s]. None: no key is pressed yet."""
        self._presses += 1
        self._is_pushing = False
        if self._presses > MAX_PRESSES:
            self.is_done = True
            return None
        if self._push is None:
            self._choose(tip, box)
        while self._way:
            axis, value, tolerance = self._way[0]
            left = value - tip[axis]
            if abs(left) > tolerance:
                return Direction.along(axis, left), time_s + abs(left) / self._speed
            self._way.pop(0)
            self._presses = 0
        push = self._push
        if push is None or self._is_pushed(tip, [0.0, 0.0], box):
            self._push, self._presses = None, 0
            return None
        self._is_pushing = True
        way = push.sign * (self._goal[push.axis] - tip[push.axis]) - _half_width(box.yaw) - TIP_RADIUS_M
        return push, time_s + max(PRESS_SHARE * way, PUSHED_M) / self._speed

    def _is_pushed(self, tip: Place, velocity: list[float], box: PlanarPose) -> bool:
        """Returns whether the push is over. A push ends when the box is at its goal along the push, when the box has
        turned too far, or when the tip has missed the box.

        Args:
            tip: Position of the tip [m].
            velocity: Velocity of the tip [m/s].
            box: Pose of the box.
        """
        assert self._push is not None
        axis, sign = self._push.axis, self._push.sign
        left = sign * (self._goal[axis] - box[axis] - velocity[axis] * REACTION_S)
        is_past = sign * (tip[axis] - box[axis]) > 0.0
        return is_past or left <= PUSHED_M or abs(box.yaw - self._goal.yaw) > self._max_turn_rad

    def _choose(self, tip: Place, box: PlanarPose) -> None:
        """Chooses the next push and the path to its start. Sets `is_done` if the box is at its goal, or if the person
        gives up.
        """
        left = (self._goal.x - box.x, self._goal.y - box.y)
        turn = box.yaw - self._goal.yaw
        is_close = math.hypot(*left) < CLOSE_M and abs(turn) < CLOSE_RAD
        if is_close or self._pushes == MAX_PUSHES or math.hypot(*left) > LOST_M:
            self.is_done = True
            return
        side = self._side(tip, box)
        gains = [abs(each) for each in left]
        gains[side.axis] += HERE_M
        axis = gains.index(max(gains))
        push = Direction.along(axis, left[axis])
        aside = turn * TURN_ARM_M2 / max(abs(left[axis]), MIN_PUSH_M)
        aside = min(max(aside, -MAX_ASIDE_M), MAX_ASIDE_M) + self._random.uniform(-MAX_AIM_ERROR_M, MAX_AIM_ERROR_M)
        self._max_turn_rad = abs(turn) + TURNED_RAD
        self._push, self._way, self._pushes = push, self._way_to(push, aside, side, box), self._pushes + 1

    @staticmethod
    def _side(tip: Place, box: PlanarPose) -> Direction:
        """Returns the side of the box on which the tip is."""
        x, y = tip[0] - box.x, tip[1] - box.y
        return Direction.along(0, x) if abs(x) > abs(y) else Direction.along(1, y)

    @staticmethod
    def _way_to(push: Direction, aside: float, side: Direction, box: PlanarPose) -> list[_Leg]:
        """Returns the path of the tip around the box to the start of a push.

        Args:
            push: Direction of the push.
            aside: Distance of the push from the middle of the box, positive to the left of the push [m].
            side: Side of the box on which the tip is.
            box: Pose of the box.
        """
        away = _half_width(box.yaw) + TIP_RADIUS_M + CLEARANCE_M
        begin, end = ROUND.index(side), (ROUND.index(push) + 2) % 4
        steps = (end - begin + 1) % 4 - 1  # -1, 0, 1 or 2 sides further round
        way = [_Leg(side.axis, box[side.axis] + side.sign * away, PASSED_M)]
        for step in range(abs(steps)):
            sign = 1 if steps > 0 else -1
            following = ROUND[(begin + sign * (step + 1)) % 4]
            way.append(_Leg(following.axis, box[following.axis] + following.sign * away, PASSED_M))
        # (-y, x) is to the left of (x, y): along x the left is y, along y it is -x
        across = 1 - push.axis
        leftward = push.sign if push.axis == 0 else -push.sign
        way.append(_Leg(across, box[across] + leftward * aside, ALIGNED_M))
        return way


def _half_width(yaw: float) -> float:
    """Returns half of the extent along x of a box with a given yaw [m]. The extent along y is equal."""
    return HALF_SIDE_M * (abs(math.cos(yaw)) + abs(math.sin(yaw)))
