"""From the segments of a person to the base and the joints of their avatar."""

import math
from typing import NamedTuple

import numpy as np

from operator_node.mvn.segments import SegmentFrame
from operator_node.mvn.skeleton import PARENTS

from .anthropometry import Array, leg_length, measured_offsets
from .joints import AXES, JOINTS, LOWER, UPPER

NEAR_SINGULAR = 1e-3
"""Cosine of the middle hinge below which the first one stays where it is; that turns the link by at most 0.06 deg."""
BEYOND = 1e-6
"""A hinge counts as beyond a limit when it is so much further [rad]."""
LEG_RATIOS = (0.2, 5.0)
"""An avatar's legs may be so many times as long as the person's."""
_TURN = 2.0 * math.pi


class AvatarPose(NamedTuple):
    """Where the avatar is.

    Attributes:
        position: Origin of the pelvis in the world (3) [m].
        quat_xyzw: Orientation of the pelvis in the world (4).
        hinges: Positions of `HINGES` (66) [rad].
    """

    position: Array
    quat_xyzw: Array
    hinges: Array


class Place(NamedTuple):
    """Where the avatar stands when the person begins, on the floor: x and y [m], and the angle about z [rad]."""

    x: float
    y: float
    yaw: float


class Retargeting:
    """Has an avatar do what a person does; one object for each, which is told one frame after the other.

    Each hinge is computed by itself, from how a segment is turned in its parent (R = R_i(a) R_j(b) R_k(c) has the
    solutions (a, b, c) and (a + pi, pi - b, c + pi)); of the two solutions and all whole turns it takes those that are
    within the limits and nearest to the last ones. So links are turned as the segments are. What limits do not allow
    is left out, and turns all segments beyond that joint with it.

    Where the avatar's lengths are not the person's, orientations win, and so the hands are elsewhere. The way of the
    pelvis is then scaled by the length of the legs, so that the feet stay on the ground.

    Args:
        offsets: Origin of each segment of the avatar in its parent (23 x 3) [m].
        place: Where the avatar stands for the first frame; without it, where the person does.
    """

    def __init__(self, offsets: Array, place: Place | None = None) -> None:
        self._leg = leg_length(offsets)
        self._place = place
        self._last = np.zeros((len(JOINTS), 3))
        self._scale: float | None = None
        self._turn, self._shift = np.eye(3), np.zeros(3)

    def begin(self, hinges: Array | None = None) -> None:
        """Begins anew with the next frame, for instance with another person.

        Args:
            hinges: Where the avatar's hinges are (66) [rad]; without them, where they were last.
        """
        self._scale = None
        if hinges is not None:
            self._last = np.array(hinges, dtype=float).reshape(-1, 3)

    def pose(self, frame: SegmentFrame) -> AvatarPose:
        """Returns where the avatar is to be.

        Raises:
            ValueError: If the person's legs are not between a fifth of the avatar's and five times as long.
        """
        rotations = _matrices(frame.quats_xyzw)
        if self._scale is None:
            self._begin(frame, rotations[0])
        relative = rotations[_PARENT].transpose(0, 2, 1) @ rotations[1:]
        self._last = _hinges(relative, self._last)
        position = self._turn @ (frame.positions[0] * self._scale) + self._shift
        return AvatarPose(position, _quat(self._turn @ rotations[0]), np.clip(self._last, _LOWER, _UPPER).reshape(-1))

    def _begin(self, frame: SegmentFrame, pelvis: Array) -> None:
        """Takes the person's size and place from the first frame."""
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
"""1 where the order of the axes is a cyclic one, else -1."""
_LOWER, _UPPER = LOWER.reshape(-1, 3), UPPER.reshape(-1, 3)
_MIDDLE = (_LOWER + _UPPER) / 2.0
_OTHER = np.array((math.pi, math.pi, math.pi))
_FLIP = np.array((1.0, -1.0, 1.0))


def _hinges(relative: Array, last: Array) -> Array:
    """Returns the hinges of all joints (22 x 3) [rad], limits left aside.

    Args:
        relative: Orientation of each segment in its parent (22 x 3 x 3).
        last: The hinges before (22 x 3) [rad].
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
    # Whole turns: into the limits, which are less than one apart; what fits in none of them, near where it was
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
    """Returns the hinges of one joint if the first of them is given [rad]."""
    c, s = math.cos(a), math.sin(a)
    row_1, row_2 = c * m[1] + sign * s * m[2], c * m[2] - sign * s * m[1]
    angles = np.array((a, math.atan2(sign * m[0, 2], row_2[2]), math.atan2(sign * row_1[0], row_1[1])))
    return np.asarray(angles + _TURN * np.round((last - angles) / _TURN))


def _matrices(quats_xyzw: Array) -> Array:
    """Returns unit quaternions x, y, z, w (n x 4) as matrices (n x 3 x 3)."""
    x, y, z, w = quats_xyzw.T
    return np.array(
        (
            (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
            (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
            (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
        )
    ).transpose(2, 0, 1)


def _quat(matrix: Array) -> Array:
    """Returns a rotation matrix as unit quaternion x, y, z, w, by the largest of its parts."""
    (a, b, c), (d, e, f), (g, h, i) = matrix
    parts = np.array(
        (
            (1.0 + a - e - i, b + d, c + g, h - f),
            (b + d, 1.0 - a + e - i, f + h, c - g),
            (c + g, f + h, 1.0 - a - e + i, d - b),
            (h - f, c - g, d - b, 1.0 + a + e + i),
        )
    )
    row = parts[int(np.argmax(np.diagonal(parts)))]
    return np.asarray(row / np.linalg.norm(row))
