"""How an arm draws a sleeve over that of a person: where its hand goes, how fast, and whether it has succeeded."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from rpbi.geometry import Pose
from rpbi.kinematics import Kinematics
from rpbi.kinematics.problem import PybulletProblem

Array = NDArray[np.float64]

CUFF = (0.86, -0.26, 1.43)
"""Where the middle of the cuff is at the start [m], as in `sleeve.yaml`."""
RADIUS_M = 0.085
"""Of the sleeve."""
AROUND, RINGS = 14, 12
"""Corners of each ring of the sleeve, and rings."""
HAND_M, BEFORE_HAND_M = 0.19, 0.05
"""Length of a hand, and how far before it the cuff is in line with the forearm [m]."""
PAST_ELBOW_M, ENOUGH_M = 0.10, 0.05
"""How far past the elbow the cuff is drawn, and how far counts as past it [m]."""
BLEND_M = 0.05
"""Over so much of its way to either side of the elbow the cuff turns [m]."""
MEAN_S = 0.1
"""Contact forces of soft bodies are rough: their mean over this time counts [s]."""
SETTLING_S = 0.5
"""For so long the cuff is held at the end of its way [s]."""
LARGEST_STEP_M = 0.02
"""The hand is led there from wherever it is, by so much for each target at most."""
ROBOT, HAND_LINK = "franka_panda/panda.urdf", "panda_grasptarget"
"""Of PyBullet's data."""
ROBOT_BASE = Pose((0.3, -0.85, 0.7))
"""Where the robot stands, as in `panda.yaml`."""
LARGEST_TURN_RAD = 0.3
"""Joints that would have to turn farther for the next target stay where they are."""
TARGET_HZ = 50
"""Targets a second."""
HELD_OUT_M = 0.25
"""So near the start of the cuff is the place before the hand of one who holds out the arm [m]."""
ARM_SEGMENTS = ("RightShoulder", "RightUpperArm", "RightForeArm", "RightHand")


class ArmPosition(NamedTuple):
    """Where the joints of a person's arm are in the world (3 each) [m]."""

    shoulder: Array
    elbow: Array
    wrist: Array


class HandTarget(NamedTuple):
    """Where the point between the fingertips of the robot is to be in the world.

    Attributes:
        position: x, y, z [m].
        quat_xyzw: Its orientation: z points at the person's arm, and x where the sleeve trails.
    """

    position: tuple[float, float, float]
    quat_xyzw: tuple[float, float, float, float]


class MeanForce:
    """The mean of a force over the last tenth of a second, and its largest value."""

    def __init__(self) -> None:
        self._values: deque[tuple[float, Array]] = deque()
        self.peak_n = 0.0

    def add(self, time_s: float, force: ArrayLike) -> float:
        """Takes a force [N] at a time and returns the size of the mean [N]."""
        self._values.append((time_s, np.asarray(force, dtype=float)))
        while self._values[0][0] < time_s - MEAN_S:
            self._values.popleft()
        size = float(np.linalg.norm(np.mean([value for _, value in self._values], axis=0)))
        self.peak_n = max(self.peak_n, size)
        return size


class Dressing:
    """Leads the cuff from where it is to before the hand, over the hand, along the forearm and past the elbow.

    The way goes along the person's arm, wherever that is at the moment. The nearer the force on it is to the limit the
    slower is the cuff; above the limit it goes back.

    Args:
        force_limit_n: Force on the arm above which the cuff goes back [N].
        speed: Of the cuff where nothing is touched [m/s].
    """

    def __init__(self, force_limit_n: float, speed: float) -> None:
        self._limit_n, self._speed = force_limit_n, speed
        self._left_m: float | None = None
        self._rested_s = 0.0
        self._cuff = np.array(CUFF)

    @property
    def has_begun(self) -> bool:
        """Whether the cuff is led already."""
        return self._left_m is not None

    @property
    def is_done(self) -> bool:
        """Whether the cuff is led no further, and has had time to get there."""
        return self._rested_s >= SETTLING_S

    def target(self, arm: ArmPosition, force_n: float, dt: float) -> HandTarget:
        """Returns where the robot's hand is to be.

        Args:
            arm: Where the person's arm is.
            force_n: Force on it [N].
            dt: Time since the last target [s].
        """
        way = _way(arm)
        length = sum(math.dist(a, b) for a, b in pairwise(way))
        if self._left_m is None:
            self._left_m = length
        speed = self._speed * max(-1.0, 1.0 - force_n / self._limit_n)
        self._left_m = min(max(self._left_m - speed * dt, 0.0), length)
        self._rested_s = 0.0 if self._left_m else self._rested_s + dt
        done = length - self._left_m
        step = _along(way, done) - self._cuff
        self._cuff = self._cuff + step * min(1.0, LARGEST_STEP_M / max(float(np.linalg.norm(step)), 1e-12))
        start = math.dist(way[0], way[1])  # up to there the cuff comes to be in line with the forearm
        ahead = _along(way, min(max(done, start) + BLEND_M, length)) - _along(way, max(done - BLEND_M, start))
        return _hand(self._cuff, ahead / np.linalg.norm(ahead))


def is_held_out(arm: ArmPosition) -> bool:
    """Returns whether an arm is held out to the cuff."""
    return math.dist(_way(arm)[1], CUFF) < HELD_OUT_M


class HandSolver:
    """Finds joint positions of the robot for its hand.

    Args:
        kinematics: The robot's.
    """

    def __init__(self, kinematics: Kinematics) -> None:
        self._kinematics = kinematics

    def solve(self, target: HandTarget, positions: Sequence[float]) -> dict[str, float] | None:
        """Returns positions of the arm's joints [rad], or None if there are none nearby.

        Args:
            target: Where the hand is to be.
            positions: Where all joints that move are now [rad or m].
        """
        in_base = ROBOT_BASE.inverse() @ Pose(target.position, target.quat_xyzw)
        problem = PybulletProblem(HAND_LINK, in_base.position, in_base.quat_xyzw, currentPosition=positions)
        solution = self._kinematics.solve(problem)
        found = dict(zip(solution.chain, solution.chain_positions))
        now = dict(zip(self._kinematics.joint_names, positions))
        near = all(abs(found[name] - now[name]) <= LARGEST_TURN_RAD for name in found)
        return found if solution.success and near else None


def _way(arm: ArmPosition) -> list[Array]:
    """Returns the corners of the cuff's way."""
    forearm = (arm.wrist - arm.elbow) / np.linalg.norm(arm.wrist - arm.elbow)
    upper_arm = (arm.shoulder - arm.elbow) / np.linalg.norm(arm.shoulder - arm.elbow)
    before = arm.wrist + (HAND_M + BEFORE_HAND_M) * forearm
    return [np.array(CUFF), before, arm.wrist, arm.elbow, arm.elbow + PAST_ELBOW_M * upper_arm]


def _along(way: Sequence[Array], distance: float) -> Array:
    """Returns the point so far along a way."""
    for a, b in pairwise(way):
        length = math.dist(a, b)
        if distance <= length:
            return a + (b - a) * (distance / max(length, 1e-12))
        distance -= length
    return way[-1]


def _hand(cuff: Array, ahead: Array) -> HandTarget:
    """Returns where the hand is that holds the cuff at its right side, level."""
    to_arm = np.cross((0.0, 0.0, 1.0), -ahead)
    to_arm /= np.linalg.norm(to_arm)
    back = -ahead
    quat = Rotation.from_matrix(np.stack((back, np.cross(to_arm, back), to_arm), axis=1)).as_quat()
    x, y, z = (cuff - RADIUS_M * to_arm).tolist()
    return HandTarget((x, y, z), tuple(quat.tolist()))


class Outcome(NamedTuple):
    """What became of it.

    Attributes:
        past_elbow_m: How far the middle of the cuff is past the elbow, along the upper arm [m].
        is_around: Whether the arm is inside the cuff, and inside the ring of the sleeve that is nearest to the elbow.
        peak_force_n: Largest force on the arm [N], as mean over 0.1 s.
    """

    past_elbow_m: float
    is_around: bool
    peak_force_n: float

    @property
    def is_dressed(self) -> bool:
        """Whether the sleeve is past the elbow."""
        return self.is_around and self.past_elbow_m >= ENOUGH_M


def outcome(corners: ArrayLike, arm: ArmPosition, peak_force_n: float) -> Outcome:
    """Returns what became of it.

    Args:
        corners: Corners of the sleeve's triangles (3 n x 3) [m], as its surface has them.
        arm: Where the person's arm is.
        peak_force_n: Largest force on the arm [N].
    """
    rings = rings_of(corners)
    upper_arm = arm.shoulder - arm.elbow
    upper_arm /= np.linalg.norm(upper_arm)
    cuff = rings[0].mean(axis=0)
    past = float(np.dot(cuff - arm.elbow, upper_arm))
    nearest = min(rings, key=lambda ring: math.dist(ring.mean(axis=0), arm.elbow))
    around = _encloses(rings[0], arm.elbow + past * upper_arm, upper_arm) and _encloses(nearest, arm.elbow, upper_arm)
    return Outcome(past, around, peak_force_n)


def rings_of(corners: ArrayLike) -> Array:
    """Returns the rings of the sleeve but the last (11 x 14 x 3) [m], from the corners of its triangles.

    Raises:
        ValueError: If it is another mesh.
    """
    triangles = np.asarray(corners, dtype=float).reshape(-1, 3, 3)
    if len(triangles) != 2 * AROUND * (RINGS - 1):
        raise ValueError(f"expected the {2 * AROUND * (RINGS - 1)} triangles of the sleeve, got {len(triangles)}")
    return triangles[::2, 0].reshape(RINGS - 1, AROUND, 3)


def _encloses(ring: Array, point: Array, axis: Array) -> bool:
    """Returns whether a ring goes once around a line through a point."""
    across = np.cross(axis, (0.0, 0.0, 1.0))
    across /= np.linalg.norm(across)
    beside = ring - point
    angles = np.arctan2(beside @ np.cross(axis, across), beside @ across)
    turns = np.angle(np.exp(1j * np.diff(np.append(angles, angles[0])))).sum() / (2.0 * np.pi)
    return bool(round(abs(turns)) == 1)
