"""Forward kinematics and Jacobians for all links of a kinematic tree, in one or many configurations."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from custom_ros_tools.transforms import matrix_of, quat_of

from .geometry import Vector
from .joint_map import AffineMap, Array
from .urdf.elements import UrdfJoint

MAX_MATRIX_PRODUCTS = 24
"""Largest number of configurations that are computed with products of 4 x 4 matrices (`_of_few`). For more
configurations, arrays with one row for each matrix entry are faster (`_of_many`)."""
_ROOT = np.eye(4)
_QUARTER = np.pi / 2.0
_YZX, _ZXY = np.array((1, 2, 0)), np.array((2, 0, 1))


class LinkFrames:
    """Computes the frames of all links of a kinematic tree, whose joints have at most one axis.

    Links that are fixed to each other share one frame. Frame 0 is the root link's frame. Each other frame moves with a
    joint: the frame's origin is the joint's origin, and the frame's z axis is the joint's axis. The k configurations
    `q` are positions of n driven joints, k x n [rad or m]. Thread-safe.

    Args:
        joints: All joints of the tree.
        to_moving: Function that takes names of moving joints, and returns the map from the n driven joints' positions
            to the moving joints' positions.

    Attributes:
        links: Names of all links, the root first.
    """

    def __init__(self, joints: Iterable[UrdfJoint], to_moving: Callable[[Sequence[str]], AffineMap]) -> None:
        self._above = {joint.child: joint for joint in joints}
        ordered = sorted(self._above.values(), key=lambda joint: self._depth(joint.child))
        self.links = (*(joint.parent for joint in ordered[:1]), *(joint.child for joint in ordered))
        self._moving = [joint for joint in ordered if joint.is_moving]
        self._frame = {joint.child: i for i, joint in enumerate(self._moving, start=1)}
        self._aligned = [np.eye(4), *(_aligned_with(joint.axis) for joint in self._moving)]
        self._to_moving = to_moving([joint.name for joint in self._moving])
        parents = [self.place(joint.parent) for joint in self._moving]
        self._parents = [frame for frame, _ in parents]
        self._turns = np.array([False, *(joint.is_revolute for joint in self._moving)])
        self._fixed = [
            pose @ origin_of(joint) @ aligned
            for joint, (_, pose), aligned in zip(self._moving, parents, self._aligned[1:])
        ]
        self._parts = np.array([[_ROOT.ravel(), *np.zeros((2, 16))], *map(_parts, self._moving, self._fixed)])
        self._factors, self._offsets = self._of_parts()
        self._slides = np.flatnonzero(~self._turns[1:]) * 3 + 4
        self._jumps: list[NDArray[np.int_]] = []
        above = np.array([0, *self._parents])
        while above.any():
            self._jumps.append(above)
            above = above[above]
        self.links = tuple(sorted(self.links, key=lambda link: self.place(link)[0]))
        places = [self.place(link) for link in self.links]
        self._frame_of_link = np.array([frame for frame, _ in places], dtype=int)
        self._pose_of_link = np.array([pose for _, pose in places])
        self._links_of_frame = np.searchsorted(self._frame_of_link, range(len(self._parts) + 1)).tolist()
        self._last = b"", np.empty((0, len(places), 4, 4))

    def place(self, link: str) -> tuple[int, Array]:
        """Returns the number of the frame that a link is fixed to, and the link's pose in this frame, 4 x 4."""
        pose = np.eye(4)
        while link in self._above and link not in self._frame:
            pose = origin_of(self._above[link]) @ pose
            link = self._above[link].parent
        frame = self._frame.get(link, 0)
        return frame, self._aligned[frame].T @ pose

    def at(self, q: Array) -> Array:
        """Returns the poses of all f frames in the root frame, k x f x 4 x 4; callers must not change the array."""
        key = q.tobytes()
        last, frames = self._last
        if key != last:
            frames = (self._of_few if len(q) <= MAX_MATRIX_PRODUCTS else self._of_many)(q)
            self._last = key, frames  # several callers request the same configurations
        return frames

    def of_links(self, q: Array) -> Array:
        """Returns the poses of all l links in the root frame, in the order of `links`, k x l x 4 x 4."""
        if len(q) <= MAX_MATRIX_PRODUCTS:
            poses: Array = self.at(q).take(self._frame_of_link, axis=1) @ self._pose_of_link
            return poses
        frames = self.at(q).transpose(1, 3, 2, 0)[:, :, :3].reshape(len(self._parts), 4, -1)
        links, upper = _rows(len(self.links), len(q))
        for frame, (first, last) in zip(frames, pairwise(self._links_of_frame)):
            poses = self._pose_of_link[first:last].transpose(0, 2, 1).reshape(-1, 4)
            np.matmul(poses, frame, out=upper[first:last].reshape(len(poses), -1))
        return links.transpose(3, 0, 2, 1)

    def positions(self, q: Array, link: str) -> Array:
        """Returns the positions of a link's origin in the root frame, k x 3 [m]."""
        frame, pose = self.place(link)
        positions: Array = self.at(q)[:, frame, :3] @ pose[:, 3]
        return positions

    def jacobian(self, q: Array, link: str, point: Sequence[float] = (0.0, 0.0, 0.0)) -> Array:
        """Returns the Jacobians of a point that is attached to a link, k x 6 x n, in the root's axes.

        The first three rows map the n joint velocities to the point's velocity [m/s]. The last three rows map the joint
        velocities to the link's angular velocity [rad/s].

        Args:
            q: The configurations, k x n [rad or m].
            link: Name of the link.
            point: Position of the point in the link's frame [m]; by default the link's origin.
        """
        frame, pose = self.place(link)
        return self._jacobian(q, frame, self.at(q)[:, frame, :3] @ (pose @ (*point, 1.0)))

    def jacobian_at(self, q: Array, link: str, point: Sequence[float]) -> Array:
        """Like `jacobian`, but takes one position of the point in the root frame [m], for all configurations."""
        return self._jacobian(q, self.place(link)[0], np.broadcast_to(point, (len(q), 3)))

    def _jacobian(self, q: Array, frame: int, tip: Array) -> Array:
        above: list[int] = []
        while frame:
            above.append(frame)
            frame = self._parents[frame - 1]
        chain = np.array(above, dtype=int)
        frames = self.at(q).take(chain, axis=1)[:, :, :3]
        axis, lever = frames[..., 2], tip[:, None] - frames[..., 3]
        turns = self._turns[chain, None]
        linear = np.where(turns, axis[..., _YZX] * lever[..., _ZXY] - axis[..., _ZXY] * lever[..., _YZX], axis)
        by_moving = np.concatenate((linear, np.where(turns, axis, 0.0)), axis=2).transpose(0, 2, 1)
        jacobian: Array = by_moving @ self._to_moving.factors[chain - 1]
        return jacobian

    def _of_parts(self) -> tuple[Array, Array]:
        """Returns the affine map from n joint positions to 3 angles for each of f frames.

        A frame's pose in its parent frame is the sum of the frame's three `_parts`, each multiplied by the sine of an
        angle. The angles are pi/2 (sine 1), the joint position, and the joint position plus pi/2 (sine equals cosine).
        For prismatic joints, the factor of the second part is the joint position itself, not its sine.

        Returns:
            Factors, shape (n, 3 * f), and offsets, shape (3 * f,).
        """
        m, n = self._to_moving.factors.shape
        factors, offsets = np.zeros((m + 1, 3, n)), np.tile((_QUARTER, 0.0, _QUARTER), (m + 1, 1))
        factors[1:, 1:] = self._to_moving.factors[:, None]
        offsets[1:, 1:] += self._to_moving.offsets[:, None]
        return factors.reshape(-1, n).T.copy(), offsets.ravel()

    def _of_few(self, q: Array) -> Array:
        """Computes the frames in few configurations: first the poses in the parent frames, then products of poses.

        Each step doubles the number of joints that a pose covers, so the products take log2(depth) steps.
        """
        angles = q.dot(self._factors)
        angles += self._offsets
        factors = np.sin(angles)
        if len(self._slides):
            factors[:, self._slides] = angles[:, self._slides]
        frames: Array = (factors.reshape(len(q), -1, 1, 3) @ self._parts).reshape(len(q), -1, 4, 4)
        for above in self._jumps:
            frames = frames.take(above, axis=1) @ frames
        return frames

    def _of_many(self, q: Array) -> Array:
        """Computes the frames in many configurations, with one row of k numbers for each matrix entry.

        Frames are computed one after the other, each from its parent frame. Matrices are stored in column-major order.
        """
        positions = self._to_moving.factors @ q.T + self._to_moving.offsets[:, None]
        sines, cosines = np.sin(positions), np.cos(positions)
        frames, upper = _rows(len(self._moving) + 1, len(q))
        frames[0] = _ROOT[:, :, None]
        for i, (joint, parent) in enumerate(zip(self._moving, self._parents)):
            np.matmul(self._fixed[i].T, upper[parent], out=upper[i + 1])
            x, y, z, origin = frames[i + 1, :, :3]
            if joint.is_revolute:
                across = frames[i + 1, :2, :3] * sines[i]
                frames[i + 1, :2, :3] *= cosines[i]
                x += across[1]
                y -= across[0]
            else:
                origin += positions[i] * z
        return frames.transpose(3, 0, 2, 1)

    def _depth(self, link: str) -> int:
        depth = 0
        while link in self._above:
            link, depth = self._above[link].parent, depth + 1
        return depth


def origin_of(joint: UrdfJoint) -> Array:
    """Returns the pose of a joint's frame in its parent link at joint position 0, 4 x 4."""
    return matrix_of(joint.xyz, quat_of(joint.rpy))


def _aligned_with(axis: Vector) -> Array:
    """Returns the pose of a frame with the origin 0, whose z axis is the unit vector `axis`, 4 x 4."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(other, axis)
    x /= np.linalg.norm(x)
    frame = np.eye(4)
    frame[:3, :3] = np.column_stack((x, np.cross(axis, x), axis))
    return frame


def _parts(joint: UrdfJoint, fixed: Array) -> Array:
    """Splits a joint's pose in its parent frame into three matrices, each flattened to a row, 3 x 16.

    Revolute joint: pose = constant part + sin(position) * second part + cos(position) * third part. Prismatic joint:
    pose = constant part + position * second part, and the third part is 0.

    Args:
        joint: The joint.
        fixed: The joint's pose at position 0, 4 x 4.
    """
    x, y, z, origin = fixed.T
    nothing = np.zeros(4)
    if joint.is_revolute:
        columns = (nothing, nothing, z, origin), (y, -x, nothing, nothing), (x, y, nothing, nothing)
    else:
        columns = (x, y, z, origin), (nothing, nothing, nothing, z), (nothing,) * 4
    return np.array(columns).transpose(0, 2, 1).reshape(3, 16)


def _rows(count: int, k: int) -> tuple[Array, Array]:
    """Allocates `count` matrices for k configurations in column-major order, with the last row set to 0, 0, 0, 1.

    Returns:
        The matrices, shape (count, 4, 4, k), and a view of their upper three rows, shape (count, 4, 3 * k).
    """
    matrices = np.empty((count, 4, 4, k))
    matrices[:, :, 3] = _ROOT[3][:, None]
    return matrices, matrices[:, :, :3].reshape(count, 4, -1)
