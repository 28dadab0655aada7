"""Maps the segments of a person to the base and the joints of an avatar, which moves there at limited speeds."""

import math
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from operator_node.mvn.segments import PARENTS, SegmentFrame

from .anthropometry import Array, leg_length, measured_offsets
from .joints import AXES, JOINTS, LOWER, UPPER

NEAR_SINGULAR = 1e-3
"""Cosine of the middle hinge below which the first one is held; this rotates the link by at most 0.06 deg."""
BEYOND = 1e-6
"""Tolerance of limits [rad]; a hinge beyond a limit by more counts as outside."""
LEG_RATIOS = (0.2, 5.0)
"""Range of the ratio of the avatar's leg length to the person's; other people are rejected."""
_TURN = 2.0 * math.pi
MAX_STEP_S = 0.1
"""Longest time that counts between two frames [s]; the rest is dropped."""


class AvatarPose(NamedTuple):
    """Pose of the avatar.

    Attributes:
        position: Origin of the pelvis in the world (3) [m].
        quat_xyzw: Orientation of the pelvis in the world (4).
        hinges: Positions of `HINGES` (66) [rad].
    """

    position: Array
    quat_xyzw: Array
    hinges: Array


class AvatarPlace(NamedTuple):
    """Initial place of the avatar on the floor: x and y [m], and the angle about z [rad]."""

    x: float
    y: float
    yaw: float


class Retargeting:
    """Computes the motion of an avatar from the frames of one person; each person needs an object of its own.

    The hinges of each joint are computed in closed form from the orientation of a segment in its parent (R = R_i(a)
    R_j(b) R_k(c) has the solutions (a, b, c) and (a + pi, pi - b, c + pi)). Of the two solutions and all whole turns,
    those within the limits and nearest to the last ones are chosen. The links then have the orientations of the
    segments. A rotation beyond a limit is cut off, which rotates all segments after that joint, too.

    Where the lengths of avatar and person differ, orientations are kept, and the hands are at other places. The
    displacement of the pelvis is then scaled by the length of the legs, so that the feet stay on the ground.

    Args:
        offsets: Origin of each segment of the avatar in its parent (23 x 3) [m].
        place: Place of the avatar at the first frame; by default that of the person.
    """

    def __init__(self, offsets: Array, place: AvatarPlace | None = None) -> None:
        self._leg = leg_length(offsets)
        self._place = place
        self._last = np.zeros((len(JOINTS), 3))
        self._scale: float | None = None
        self._turn, self._shift = np.eye(3), np.zeros(3)

    def begin(self, hinges: Array | None = None) -> None:
        """Restarts with the next frame, for instance with another person.

        Args:
            hinges: Present positions of the avatar's hinges (66) [rad]; by default the last ones.
        """
        self._scale = None
        if hinges is not None:
            self._last = np.array(hinges, dtype=float).reshape(-1, 3)

    def pose(self, frame: SegmentFrame) -> AvatarPose:
        """Returns the pose of the avatar.

        Raises:
            ValueError: If the ratio of the leg lengths is outside of `LEG_RATIOS`.
        """
        rotations = Rotation.from_quat(frame.quats_xyzw).as_matrix()
        if self._scale is None:
            self._begin(frame, rotations[0])
        relative = rotations[_PARENT].transpose(0, 2, 1) @ rotations[1:]
        self._last = _hinges(relative, self._last)
        position = self._turn @ (frame.positions[0] * self._scale) + self._shift
        quat = Rotation.from_matrix(self._turn @ rotations[0]).as_quat()
        return AvatarPose(position, quat, np.clip(self._last, _LOWER, _UPPER).reshape(-1))

    def _begin(self, frame: SegmentFrame, pelvis: Array) -> None:
        """Determines scale and displacement from the first frame of the person."""
        ratio = self._leg / max(leg_length(measured_offsets(frame)), 1e-9)
        if not LEG_RATIOS[0] <= ratio <= LEG_RATIOS[1]:
            least, most = (self._leg / each for each in reversed(LEG_RATIOS))
            raise ValueError(f"expected legs of {least:.2g} to {most:.2g} m, got {self._leg / ratio:.2g} m")
        self._scale = ratio
        if self._place is not None:
            turn = self._place.yaw - math.atan2(pelvis[1, 0], pelvis[0, 0])
            c, s = math.cos(turn), math.sin(turn)
            self._turn = np.array(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))
            start = self._turn @ (frame.positions[0] * ratio)
            self._shift = np.array((self._place.x - start[0], self._place.y - start[1], 0.0))


_PARENT = np.array(PARENTS[1:])
_ORDER = np.array([[AXES.index(axis) for axis in joint.order] for joint in JOINTS])
_ROWS, _COLUMNS = _ORDER[:, :, None], _ORDER[:, None, :]
_NUMBER = np.arange(len(JOINTS))[:, None, None]
_SIGN = np.array([1.0 if joint.order in ("xyz", "yzx", "zxy") else -1.0 for joint in JOINTS])
"""1 where the order of the axes is cyclic, else -1."""
_LOWER, _UPPER = LOWER.reshape(-1, 3), UPPER.reshape(-1, 3)
_MIDDLE = (_LOWER + _UPPER) / 2.0
_OTHER = np.array((math.pi, math.pi, math.pi))
_FLIP = np.array((1.0, -1.0, 1.0))


def _hinges(relative: Array, last: Array) -> Array:
    """Returns the hinges of all joints (22 x 3) [rad], without regard to limits.

    Args:
        relative: Orientation of each segment in its parent (22 x 3 x 3).
        last: The last hinges (22 x 3) [rad].
    """
    m = relative[_NUMBER, _ROWS, _COLUMNS]  # as if all orders were x, y, z
    cosine = np.hypot(m[:, 0, 0], m[:, 0, 1])
    first = np.stack(
        (
            np.arctan2(-_SIGN * m[:, 1, 2], m[:, 2, 2]),
            np.arctan2(_SIGN * m[:, 0, 2], cosine),
            np.arctan2(-_SIGN * m[:, 0, 1], m[:, 0, 0]),
        ),
        axis=1,
    )
    both = np.stack((first, _OTHER + _FLIP * first))
    # Whole turns: into the limits, whose width is less than one; if none fits, near the last value
    inside = both + _TURN * np.round((_MIDDLE - both) / _TURN)
    fits = (inside >= _LOWER - BEYOND) & (inside <= _UPPER + BEYOND)
    both = np.where(fits, inside, both + _TURN * np.round((last - both) / _TURN))
    beyond = np.abs(both - np.clip(both, _LOWER, _UPPER)).sum(axis=2)
    cost = np.where(beyond > BEYOND, 10.0 + beyond, 0.0) + 0.1 * np.abs(both - last).sum(axis=2)
    chosen = np.where((cost[0] <= cost[1])[:, None], both[0], both[1])
    for index in np.flatnonzero(cosine < NEAR_SINGULAR):
        held = _with_first(last[index, 0], m[index], _SIGN[index], last[index])
        if ((held >= _LOWER[index]) & (held <= _UPPER[index])).all():
            chosen[index] = held
    return np.asarray(chosen)


def _with_first(a: float, m: Array, sign: float, last: Array) -> Array:
    """Returns the hinges of one joint for a given first hinge [rad]."""
    c, s = math.cos(a), math.sin(a)
    row_1, row_2 = c * m[1] + sign * s * m[2], c * m[2] - sign * s * m[1]
    angles = np.array((a, math.atan2(sign * m[0, 2], row_2[2]), math.atan2(sign * row_1[0], row_1[1])))
    return np.asarray(angles + _TURN * np.round((last - angles) / _TURN))


class Engagement:
    """Moves the avatar to its target pose at limited speeds, at the start, after a pause, and at any other time.

    Args:
        max_joint_speed: Largest speed of each hinge [rad/s].
        max_speed: Largest speed of the pelvis [m/s].
        max_angular_speed: Largest angular speed of the pelvis [rad/s].
    """

    def __init__(self, max_joint_speed: float, max_speed: float, max_angular_speed: float) -> None:
        self._joint_speed, self._speed, self._angular_speed = max_joint_speed, max_speed, max_angular_speed
        self._last: AvatarPose | None = None

    def begin(self, pose: AvatarPose) -> None:
        """Sets the present pose of the avatar, from which the next step starts."""
        self._last = pose

    def step(self, target: AvatarPose, dt: float) -> AvatarPose:
        """Returns the next pose of the avatar.

        Args:
            target: Its target pose.
            dt: Time since the last step [s].
        """
        if self._last is None:
            self._last = target
        last, dt = self._last, min(dt, MAX_STEP_S)
        hinge_step, displacement = self._joint_speed * dt, target.position - last.position
        distance = float(np.linalg.norm(displacement))
        position = last.position + displacement * min(1.0, self._speed * dt / max(distance, 1e-12))
        hinges = last.hinges + np.clip(target.hinges - last.hinges, -hinge_step, hinge_step)
        quat = _turned(last.quat_xyzw, target.quat_xyzw, self._angular_speed * dt)
        self._last = AvatarPose(position, quat, hinges)
        return self._last


def _turned(start: Array, end: Array, most_rad: float) -> Array:
    """Returns a quaternion on the shortest path between two, limited to an angle from the first [rad]."""
    first = Rotation.from_quat(start)
    rotvec = (first.inv() * Rotation.from_quat(end)).as_rotvec()
    angle = float(np.linalg.norm(rotvec))
    if angle <= most_rad:
        return end
    return np.asarray((first * Rotation.from_rotvec(rotvec * (most_rad / angle))).as_quat())
