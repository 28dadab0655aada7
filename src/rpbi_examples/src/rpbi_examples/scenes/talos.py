"""A Talos stands on its feet, reaches for a ball, is pushed, and moves its hand back to the ball."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache

import numpy as np

from robot_model.asset_files import find_file
from robot_model.geometry import Pose, Vector, minus, norm, quaternion_of, quaternion_product, scaled
from robot_model.model import RobotModel

from .parts.arm import tilt_deg
from .scene import Scene, SceneFailedError, Watched

URDF = "{example-robot-data}/robots/talos_data/robots/talos_reduced_box.urdf"
HAND, POINT = "gripper_left_base_link", Pose((0.0, 0.0, -0.13))
"""Link of the hand, and the point between the fingers in the link's frame [m], as in configs/talos/talos.yaml."""
TORSO, SOLES, FEET = "torso_2_link", ("left_sole_link", "right_sole_link"), {"leg_left_6_link", "leg_right_6_link"}
HEIGHT_M, LOWEST_M = 1.0223, 0.8
"""Nominal height of the pelvis at the start, and least height of the pelvis of a standing robot [m]."""
MOST_SHIFT, MOST_RISE_M, MOST_TURN = 0.05, 2e-3, (0.01, 0.01, 0.2)
"""Largest random deviations of the start pose: in x and y [m], height [m], and rotation about x, y and z [rad]."""
NEAREST, FARTHEST = (0.35, 0.05, 0.9), (0.55, 0.4, 1.3)
"""Corners of the region of targets: x forwards and y to the left from the pelvis, z above the floor [m]."""
FORWARD = quaternion_of((0.0, -math.pi / 2.0, 0.0))
"""Orientation of a hand that points forward."""
IMPULSE, PUSH_S = 10.0, 0.1
"""Impulse of a push [N s], and its duration [s]."""
REACHED_S, BACK_S, STAYS_S = 3.0, 4.0, 2.0
"""Time for reaching the target, time for moving back to the target after a push, and time for staying there [s]."""
NEAR_M, MAX_SLIP_M, MAX_LEAN_DEG, MOST_LEAN_DEG = 0.02, 0.01, 5.0, 15.0
"""Limits of success: error of the hand [m], motion of the feet [m], tilt of the torso at the end and at any time [deg].
"""


class Talos(Scene):
    """A torque-controlled Talos reaches for a ball, and keeps its balance when the torso is pushed.

    Attributes:
        target: Target pose, in the world, of the point between the fingers.
        push_angle: Random direction of the push: the angle from the robot's initial forward direction, positive to the
            left [rad].
        impulse: Impulse of the push [N s].
    """

    world = "{rpbi_examples}/configs/talos/config.yaml"
    watch = Watched(robots=("talos",), bodies=("talos",), contacts=("floor",))
    hands = {"talos/balance": HAND}

    def __init__(self, random: np.random.Generator) -> None:
        super().__init__(random)
        self._robot = _robot()
        x, y, above, *turn = random.uniform(-1.0, 1.0, 6) * (MOST_SHIFT, MOST_SHIFT, MOST_RISE_M, *MOST_TURN)
        yaw, tilt = quaternion_of((0.0, 0.0, turn[2])), quaternion_of((turn[0], turn[1], 0.0))
        self._start = Pose((x, y, HEIGHT_M + abs(above)), quaternion_product(yaw, tilt))
        in_front: Vector = tuple(random.uniform(NEAREST, FARTHEST).tolist())
        self.target = Pose((x, y, 0.0), yaw) @ Pose(in_front, FORWARD)
        self.goal_numbers = self.target.position
        self._yaw, self.push_angle = turn[2], float(random.uniform(-math.pi, math.pi))
        self.impulse, self._until_push_s = IMPULSE, float(random.uniform(0.0, 1.0))
        self._feet: list[Vector] = []
        self._most_lean_deg = self._slip_m = self._late_error_m = 0.0
        self._is_late = self._has_stayed = self._has_touched = False

    def prepare(self) -> None:
        """Puts the robot on the floor at a random, slightly tilted pose."""
        self.place("talos", self._start)
        if self.is_noisy:
            self.tune("talos/balance", noise_seed=int(self._noise[2].integers(2**31)))

    def act(self) -> Iterator[None]:
        """Makes the robot stand and reach for the ball; then continues with `beside`, which pushes the robot."""
        self.landmarks = {"ball": self.target}
        yield from self._stand(0.5)
        self.put("talos/balance/target", self.sensed.poses["ball"])
        yield from self.beside()

    def beside(self) -> Iterator[None]:
        """Shows the ball, waits while the hand reaches the ball, pushes the robot, and waits while the hand returns.

        Raises:
            SceneFailedError: If the hand does not reach the ball, or the robot falls.
        """
        self._feet = [self.pose(sole).position for sole in SOLES]
        self.place("ball", self.target)
        yield from self._stand(REACHED_S)
        if self._error_m() > NEAR_M:
            raise SceneFailedError(f"the hand does not reach the ball: it is {1e3 * self._error_m():.0f} mm away")
        yield from self._stand(self._until_push_s)
        yield from self._push()
        yield from self._stand(BACK_S - PUSH_S)
        self._is_late = True
        yield from self._stand(STAYS_S)
        self._has_stayed = True

    def note(self) -> None:
        """Records the torso's tilt, contacts with the floor, motion of the feet, and error of the hand."""
        if self._feet:
            self._has_touched |= any(touch.other_link not in FEET for touch in self.seen.contacts["floor"])
            self._most_lean_deg = max(self._most_lean_deg, tilt_deg(self.pose(TORSO)))
            ways = [norm(minus(self.pose(sole).position, start)) for sole, start in zip(SOLES, self._feet)]
            self._slip_m = max(self._slip_m, *ways)
        if self._is_late:
            self._late_error_m = max(self._late_error_m, self._error_m())

    def has_succeeded(self) -> bool:
        """Returns whether the robot stood only on its feet, is upright, and has returned the hand to the ball."""
        stood = not self._has_touched and self._slip_m < MAX_SLIP_M and self._most_lean_deg < MOST_LEAN_DEG
        on_floor = {touch.other_link for touch in self.seen.contacts["floor"]}
        stands = on_floor == FEET and tilt_deg(self.pose(TORSO)) < MAX_LEAN_DEG
        return stood and stands and self._has_stayed and self._late_error_m < NEAR_M

    def figures(self) -> dict[str, float]:
        """Returns the hand's largest error after its return, the torso's largest tilt, and a foot's largest motion."""
        return {
            "hand error [mm]": 1e3 * (self._late_error_m if self._is_late else self._error_m()),
            "largest lean [deg]": self._most_lean_deg,
            "feet slip [mm]": 1e3 * self._slip_m,
        }

    def pose(self, link: str) -> Pose:
        """Returns the present pose of a link in the world."""
        joints = self.seen.joints["talos"]
        return self.seen.poses["talos"] @ self._robot.pose([joints[name] for name in self._robot.joint_names], link)

    def _push(self) -> Iterator[None]:
        """Pushes the torso for `PUSH_S`. Meanwhile, a stick shows the direction of the push."""
        angle = self._yaw + self.push_angle
        cos, sin = math.cos(angle), math.sin(angle)
        behind = minus(self.pose(TORSO).position, scaled(0.6, (cos, sin, 0.0)))
        self.place("stick", Pose(behind, quaternion_of((-sin * math.pi / 2.0, cos * math.pi / 2.0, 0.0))))
        self.shove(f"talos/{TORSO}", scaled(self.impulse / PUSH_S, (cos, sin, 0.0)), PUSH_S)
        yield from self._stand(PUSH_S)
        self.place("stick", Pose((0.0, 0.0, -1.0)))  # out of sight

    def _stand(self, duration_s: float) -> Iterator[None]:
        """Waits for a duration [s] while the robot stands.

        Raises:
            SceneFailedError: If the robot falls.
        """
        for _ in self.wait(duration_s):
            yield
            if self.seen.poses["talos"].position[2] < LOWEST_M:
                raise SceneFailedError("the robot has fallen")

    def _error_m(self) -> float:
        return norm(minus((self.pose(HAND) @ POINT).position, self.target.position))


@cache
def _robot() -> RobotModel:
    return RobotModel(find_file(URDF, ""))
