"""A Kinova Jaco arm grasps a cup that contains balls, lifts the cup and puts the cup on a shelf."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from robot_model.geometry import ZERO, Pose, Vector, minus, norm, rotated

from .parts.arm import about_z
from .parts.polar import PolarArm, PolarPoint
from .scene import Scene, SceneFailedError, Watched

TABLE_M = 0.5
"""Height of the table on which the arm is mounted [m]."""
SHELF_M = (0.12, 0.70)
"""Position x, y of the shelf, as in configs/cup/shelf.yaml [m]."""
INNER_RADIUS_M, CUP_HEIGHT_M, BALL_RADIUS_M = 0.0315, 0.08, 0.013
BALLS = ("ball_1", "ball_2", "ball_3", "ball_4", "ball_5")
FINGERS = ("1", "2")
PALM = "j2s6s200_link_6"
GRASP_M, NEAR_M = 0.05, 0.01
"""Height of the grasp above the bottom of the cup, and distance from the cup at which the slow approach starts [m]."""
BACK_M, FRONT_M, ABOVE_M = 0.13, 0.2, 0.05
"""Distance of the hand from the cup before and after a grasp, distance of the cup before the shelf, and height of the
lift [m].
"""
SPEED, SLOW_SPEED, TURN_SPEED = 0.09, 0.03, 0.28
"""Mean speeds of the hand [m/s], and mean angular speed of the hand about the arm's base [rad/s]."""
OPEN, CLOSED = (0.4, 0.2), (1.4, 1.4)
"""Targets of a finger's two joints [rad]. The closed targets are inside the cup, so that the fingers press with full
effort.
"""
MAX_OFF_M, MAX_TILT_DEG, AT_REST_M = 0.02, 5.0, 0.0002
"""Limits of success for the cup: distance from its goal [m], tilt [deg], and motion in a cycle [m]."""
Bend = tuple[float, float]


class Cup(Scene):
    """A Kinova Jaco arm grasps a cup that contains balls, and puts the cup on a shelf without spilling a ball."""

    world = "{rpbi_examples}/configs/cup/config.yaml"
    watch = Watched(robots=("kinova",), bodies=("cup", "shelf", *BALLS), contacts=("cup",))
    longest_s = 40.0

    def __init__(self, random: np.random.Generator) -> None:
        super().__init__(random)
        self._goal = Pose((*random.uniform((-0.12, -0.03), (0.12, 0.03)).tolist(), 0.0))
        self.goal_numbers = self._goal.position  # in the frame of the shelf
        self._largest_tilt_deg, self._moved_m, self._last = 0.0, math.inf, ZERO

    def prepare(self) -> None:
        """Puts a cup with random friction on the table, the balls into the cup, and the shelf at a random height."""
        radius, azimuth, yaw = self.random.uniform((0.58, -0.6, -math.pi), (0.7, 0.2, math.pi)).tolist()
        cup = Pose(PolarPoint(radius, azimuth, TABLE_M).pose().position, about_z(yaw))
        self.place("cup", cup)
        self.change("cup", lateralFriction=float(self.random.uniform(0.4, 1.0)))
        for number, ball in enumerate(BALLS):
            out, angle = self.random.uniform((0.0, -math.pi), (INNER_RADIUS_M - 1.1 * BALL_RADIUS_M, math.pi)).tolist()
            self.place(ball, cup @ PolarPoint(out, angle, 0.02 + 2.1 * BALL_RADIUS_M * number).pose())
        self.place("shelf", Pose((*SHELF_M, TABLE_M + float(self.random.uniform(0.15, 0.3)))))

    def act(self) -> Iterator[None]:
        """Approaches, grasps and lifts the cup, moves the cup to the shelf, puts the cup down and retreats."""
        urdf = "{rpbi_examples}/robots/kinova_hand.urdf"
        arm = PolarArm(self, "kinova", urdf, "base", "j2s6s200_end_effector", Pose((0.0, 0.0, TABLE_M)))
        start = PolarPoint.of(self.sensed.poses["cup"].position)
        yield from self._move_fingers(OPEN, OPEN, 0.02)
        for out in (-BACK_M, -NEAR_M):
            yield from arm.swing(start.moved(out, GRASP_M), SPEED, TURN_SPEED)
        yield from self._until(PALM, arm.swing(start.moved(NEAR_M, GRASP_M), SLOW_SPEED, TURN_SPEED))
        yield from self._move_fingers(OPEN, CLOSED, 1.0)
        if not {f"j2s6s200_link_finger_tip_{n}" for n in FINGERS} <= self._touching():
            raise SceneFailedError("kinova: expected both fingertips at the cup, got a hand that closed next to it")
        yield from arm.swing(arm.spot.moved(up=ABOVE_M), SPEED, TURN_SPEED)
        yield from self.measure()
        cup = PolarPoint.of(self.sensed.poses["cup"].position)
        risen_mm, expected_mm = 1e3 * (cup.height - start.height), 1e3 * ABOVE_M
        if risen_mm < 0.9 * expected_mm:
            raise SceneFailedError(f"kinova: expected the cup to rise by {expected_mm:.0f} mm, got {risen_mm:.0f} mm")
        goal = PolarPoint.of((self.sensed.poses["shelf"] @ self._goal).position)
        above = PolarPoint(*(end + hand - held for end, hand, held in zip(goal, arm.spot, cup))).moved(up=ABOVE_M)
        for out in (-FRONT_M, 0.0):
            yield from arm.swing(above.moved(out), SPEED, TURN_SPEED)
        yield from self._until("shelf", arm.swing(above.moved(up=-1.2 * ABOVE_M), SLOW_SPEED, TURN_SPEED))
        yield from self._move_fingers(CLOSED, OPEN, 1.0)
        yield from arm.swing(arm.spot.moved(-BACK_M), SPEED, TURN_SPEED)
        yield from self.wait(0.5)

    def note(self) -> None:
        """Records tilt and motion of the cup."""
        place = self.seen.poses["cup"].position
        self._largest_tilt_deg = max(self._largest_tilt_deg, self._tilt_deg())
        self._moved_m, self._last = norm(minus(place, self._last)), place

    def has_succeeded(self) -> bool:
        """Returns whether the released cup is upright and at rest at its goal on the shelf, with all balls inside."""
        is_there = self._off_m() < MAX_OFF_M and self._touching() - {*BALLS} == {"shelf"}
        stands = self._moved_m < AT_REST_M and self._tilt_deg() < MAX_TILT_DEG
        return is_there and stands and self._balls_inside() == len(BALLS)

    def fault(self) -> str:
        """Returns a text with the number of spilled balls. Empty if all balls are in the cup."""
        spilled = len(BALLS) - self._balls_inside()
        return f"{spilled} of {len(BALLS)} balls spilled" if spilled else ""

    def figures(self) -> dict[str, float]:
        """Returns the number of balls in the cup, and the cup's distance from the goal, final tilt and largest tilt."""
        return {
            "balls inside": self._balls_inside(),
            "off [mm]": 1e3 * self._off_m(),
            "tilt [deg]": self._tilt_deg(),
            "largest tilt [deg]": self._largest_tilt_deg,
        }

    def _until(self, name: str, motion: Iterator[None]) -> Iterator[None]:
        """Continues a motion until the body or robot link `name` touches the cup.

        Raises:
            SceneFailedError: If the motion ends without contact.
        """
        for _ in motion:
            if name in self._touching():
                return
            yield
        raise SceneFailedError(f"kinova: expected the cup to touch {name}, got no contact on the whole way")

    def _move_fingers(self, start: Bend, end: Bend, duration_s: float) -> Iterator[None]:
        begin_s, share = self.seen.time_s, 0.0
        while share < 1.0:
            share = min((self.seen.time_s - begin_s) / duration_s, 1.0)
            finger, tip = (a + share * (b - a) for a, b in zip(start, end))
            each = {f"finger_{n}": finger for n in FINGERS} | {f"finger_tip_{n}": tip for n in FINGERS}
            self.put("kinova/target", {f"j2s6s200_joint_{name}": target for name, target in each.items()})
            yield

    def _touching(self) -> set[str]:
        """Returns the names of all bodies that touch the cup; for the robot, the names of the touching links."""
        touches = self.seen.contacts["cup"]
        return {touch.other_link if touch.other == "kinova" else touch.other for touch in touches}

    def _goal_in_world(self) -> Vector:
        return (self.seen.poses["shelf"] @ self._goal).position

    def _off_m(self) -> float:
        return norm(minus(self.seen.poses["cup"].position, self._goal_in_world()))

    def _tilt_deg(self) -> float:
        up = rotated(self.seen.poses["cup"].quat_xyzw, (0.0, 0.0, 1.0))
        return math.degrees(math.acos(min(up[2], 1.0)))

    def _balls_inside(self) -> int:
        cup = self.seen.poses["cup"].inverse()
        spots = [PolarPoint.of((cup @ self.seen.poses[ball]).position) for ball in BALLS]
        return sum(spot.radius < INNER_RADIUS_M and 0.0 < spot.height < CUP_HEIGHT_M for spot in spots)
