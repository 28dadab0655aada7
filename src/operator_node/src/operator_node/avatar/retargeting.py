"""Maps the segment poses of a person to the base and the hinges of an avatar, and limits the speeds of the avatar."""

import math
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from operator_node.mvn.segments import PARENTS, SegmentFrame

from .anthropometry import Array, leg_length, measured_offsets
from .joints import AXES, JOINTS, LOWER, UPPER

NEAR_SINGULAR = 1e-3
"""Cosine of a joint's middle hinge below which its first hinge is held. This rotates the link by at most 0.06 deg."""
BEYOND = 1e-6
"""Angle by which a hinge may exceed a limit and still count as inside [rad]."""
LEG_RATIOS = (0.2, 5.0)
"""Allowed range of the avatar's leg length divided by the person's leg length."""
_TURN = 2.0 * math.pi
MAX_STEP_S = 0.1
"""Longest time between two frames that counts for the speed limits [s]. Longer times count as this time."""


class AvatarPose(NamedTuple):
    """Pose of the avatar.

    Attributes:
        position: Origin of the pelvis in the world (3) [m].
        quat_xyzw: Orientation of the pelvis in the world (4), x, y, z, w.
        hinges: Angles of `HINGES` (66) [rad].
    """

    position: Array
    quat_xyzw: Array
    hinges: Array


class AvatarPlace(NamedTuple):
    """Initial position of the avatar on the floor, x and y [m], and rotation of the avatar about z [rad]."""

    x: float
    y: float
    yaw: float


class Retargeting:
    """Computes poses of an avatar from the motion-capture frames of one person. Each person needs a separate object.

    The three hinge angles of a joint are computed in closed form from the orientation of a segment in its parent:
    R = R_i(a) R_j(b) R_k(c) has the solutions (a, b, c) and (a + pi, pi - b, c + pi), plus full turns. The solution
    within the limits that is nearest to the last angles is chosen. The avatar's links then have the orientations of the
    person's segments. An angle beyond a limit is clipped, which also rotates all segments further from the pelvis.

    If avatar and person differ in size, orientations are kept, but positions such as those of the hands differ. The
    displacement of the pelvis is scaled by the ratio of the leg lengths, so that the feet stay on the ground.

    Args:
        offsets: Origin of each segment of the avatar in its parent's frame (23 x 3) [m].
        place: Place of the avatar at the first frame; None for the place of the person.
    """

    def __init__(self, offsets: Array, place: AvatarPlace | None = None) -> None:
        self._leg = leg_length(offsets)
        self._place = place
        self._last = np.zeros((len(JOINTS), 3))
        self._scale: float | None = None
        self._turn, self._shift = np.eye(3), np.zeros(3)

    def begin(self, hinges: Array | None = None) -> None:
        """Restarts the mapping with the next motion-capture frame, for instance because another person takes over.

        Args:
            hinges: Present angles of the avatar's hinges (66) [rad]; None: the last computed angles.
        """
        self._scale = None
        if hinges is not None:
            self._last = np.array(hinges, dtype=float).reshape(-1, 3)

    def pose(self, frame: SegmentFrame) -> AvatarPose:
        """Returns the avatar's pose for a motion-capture frame of the person.

        Raises:
            ValueError: If the ratio of the leg lengths is outside `LEG_RATIOS`.
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
        """Computes scale, rotation and displacement between person and avatar from the person's first frame."""
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
"""Sign of each joint: 1 if the order of its axes is cyclic, otherwise -1."""
_LOWER, _UPPER = LOWER.reshape(-1, 3), UPPER.reshape(-1, 3)
_MIDDLE = (_LOWER + _UPPER) / 2.0
_OTHER = np.array((math.pi, math.pi, math.pi))
_FLIP = np.array((1.0, -1.0, 1.0))


def _hinges(relative: Array, last: Array) -> Array:
    """Returns the hinge angles of all joints (22 x 3) [rad].

    If possible, chooses solutions within the limits. Other angles are returned without clipping.

    Args:
        relative: Orientation of each segment in its parent, as rotation matrices (22 x 3 x 3).
        last: The last hinge angles (22 x 3) [rad].
    """
    m = relative[_NUMBER, _ROWS, _COLUMNS]  # permuted, as if the order of all joints were x, y, z
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
    # Adds full turns to get within the limits, whose width is less than one turn; otherwise to get near the last angle
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
    """Returns the three hinge angles of one joint whose first hinge is held at the angle `a` [rad].

    Args:
        a: Angle of the first hinge [rad].
        m: Orientation of the joint's segment in its parent (3 x 3), permuted to the order of axes x, y, z.
        sign: 1 if the order of the joint's axes is cyclic, otherwise -1.
        last: The joint's last hinge angles (3) [rad], near which the result is chosen.
    """
    c, s = math.cos(a), math.sin(a)
    row_1, row_2 = c * m[1] + sign * s * m[2], c * m[2] - sign * s * m[1]
    angles = np.array((a, math.atan2(sign * m[0, 2], row_2[2]), math.atan2(sign * row_1[0], row_1[1])))
    return np.asarray(angles + _TURN * np.round((last - angles) / _TURN))


class Engagement:
    """Moves the avatar towards its target pose at limited speeds, also at the start and after a pause.

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
        """Moves the avatar towards a target pose, and returns the avatar's new pose.

        Args:
            target: Target pose of the avatar.
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
    """Rotates the orientation `start` towards `end` by at most `most_rad` [rad], and returns the result."""
    first = Rotation.from_quat(start)
    rotvec = (first.inv() * Rotation.from_quat(end)).as_rotvec()
    angle = float(np.linalg.norm(rotvec))
    if angle <= most_rad:
        return end
    return np.asarray((first * Rotation.from_rotvec(rotvec * (most_rad / angle))).as_quat())
