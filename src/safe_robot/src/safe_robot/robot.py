"""The robot that is guarded: its joints, and where its links are."""

import math
from collections.abc import Sequence

import numpy as np

from custom_ros_tools.errors import ConfigError, Problem, UnknownNameError
from custom_ros_tools.transforms import quat_of
from rpbi.geometry import Vector
from rpbi.urdf.document import UrdfDocument
from rpbi.urdf.elements import UrdfJoint

from .frames import LinkFrames


class GuardedRobot:
    """The joints of a robot that commands move, in the order in which they are checked, and its kinematics.

    Joints that are not guarded stand at 0, or at the limit that is nearest to it; those that mimic others follow.

    Args:
        urdf_path: Its description.
        joint_names: The n joints that are guarded; without any all that move by themselves.

    Attributes:
        urdf_path: Its description.
        document: The same, read.
        joint_names: The n joints.
        joints: What the description says of them.
        links: Names of all links.
        still: Names of the joints that do not move, which joint states may have too.
        frames: Where its links are.

    Raises:
        ConfigError: If the description cannot be read or a joint makes no sense.
        UnknownNameError: If a joint is not known or does not move by itself.
    """

    def __init__(self, urdf_path: str, joint_names: Sequence[str] = ()) -> None:
        self.urdf_path = urdf_path
        self.document = document = UrdfDocument(urdf_path, not_xml="expected well-formed XML")
        try:
            self._all = document.joints
        except ValueError as error:
            raise ConfigError([Problem(urdf_path, "", str(error))]) from None
        self._root = document.root_link()
        movable = [name for name, joint in self._all.items() if joint.is_moving and joint.mimic is None]
        for name in joint_names:
            if name not in movable:
                raise UnknownNameError("joint that moves by itself", name, movable)
        self.joint_names = tuple(joint_names) or tuple(movable)
        if not self.joint_names:
            raise ConfigError([Problem(urdf_path, "", "expected a joint that moves, got none")])
        self.joints = [self._all[name] for name in self.joint_names]
        self.links = document.links
        self.still = frozenset(name for name, joint in self._all.items() if joint.type == "fixed")
        self._above = {joint.child: joint for joint in self._all.values()}
        self._index = {name: i for i, name in enumerate(self.joint_names)}
        self._turns = {joint.name: _Turn(joint) for joint in self._all.values()}
        self.frames = LinkFrames(self._all.values(), self.coupling)

    def check_link(self, name: str) -> str:
        """Returns the name of a link.

        Raises:
            UnknownNameError: If there is no such link.
        """
        if name not in self.links:
            raise UnknownNameError("link", name, self.links)
        return name

    def chain(self, link: str) -> list[UrdfJoint]:
        """Returns the joints from the root to a link."""
        joints = []
        while link != self._root:
            joints.append(self._above[link])
            link = joints[-1].parent
        return joints[::-1]

    def link_positions(self, q: np.ndarray, link: str) -> np.ndarray:
        """Returns where the origin of a link is in the root, k x 3 [m], in k configurations of n positions."""
        position = np.zeros((1, 3))
        for joint in reversed(self.chain(link)):
            position = self._turns[joint.name].carry(self._positions(joint, q), position)
        return np.broadcast_to(position, (len(q), 3))

    def coupling(self, names: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
        """Returns how m joints follow from the n guarded ones: factors, m x n, and offsets, m [rad or m]."""
        offsets = self._positions_at(names, np.zeros(len(self.joint_names)))
        columns = [self._positions_at(names, unit) - offsets for unit in np.eye(len(self.joint_names))]
        return np.stack(columns, axis=1), offsets

    def _positions_at(self, names: Sequence[str], q: np.ndarray) -> np.ndarray:
        return np.array([float(self._positions(self._all[name], q[None])[0]) for name in names])

    def _positions(self, joint: UrdfJoint, q: np.ndarray) -> np.ndarray:
        """Returns k positions of any joint; 1 if it is the same in all."""
        if joint.mimic is not None:
            leader = self._all[joint.mimic.joint]
            return joint.mimic.multiplier * self._positions(leader, q) + joint.mimic.offset
        if joint.name in self._index:
            return q[:, self._index[joint.name]]
        return np.array([min(max(0.0, joint.lower), joint.upper)])

    def reach(self, link: str, radius_m: float, other: str | None = None) -> np.ndarray:
        """Returns how far, at most, each of n joints moves any point of a link in another link, for 1 rad or m each.

        Args:
            link: The link.
            radius_m: How far its shape goes from its origin [m].
            other: The other link, by default the root; what both hang on does not move one in the other.
        """
        still = {joint.name for joint in self.chain(self._root if other is None else other)}
        reach, beyond = np.zeros(len(self.joint_names)), radius_m
        for joint in reversed(self.chain(link)):
            if joint.name in still:
                break
            i = self._driver(joint)
            if i is not None:
                factor = abs(joint.mimic.multiplier) if joint.mimic else 1.0
                reach[i] += factor * (beyond if joint.is_revolute else 1.0)
            travel = 0.0 if joint.is_revolute or not joint.is_moving else max(abs(joint.lower), abs(joint.upper))
            beyond += math.hypot(*joint.xyz) + travel
        return reach

    def _driver(self, joint: UrdfJoint) -> int | None:
        if not joint.is_moving:
            return None
        return self._index.get(joint.mimic.joint if joint.mimic else joint.name)


class _Turn:
    """What a joint does to what hangs on it, after Rodrigues: R = R0 (1 + sin q K + (1 - cos q) K^2)."""

    def __init__(self, joint: UrdfJoint) -> None:
        self._fixed, self._shift = _matrix(joint.rpy), np.array(joint.xyz)
        self._joint = joint
        x, y, z = joint.axis
        cross = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))
        sine, versine = self._fixed @ cross, self._fixed @ cross @ cross
        self._way = self._fixed @ np.array(joint.axis)
        self._carrying = np.concatenate((self._fixed + versine, sine, -versine)).T.copy()

    def carry(self, position: np.ndarray, point: np.ndarray) -> np.ndarray:
        """Returns where k points, or one, that hang on it are in what it hangs on, k x 3, at k positions."""
        if not point.any():
            turned = point
        elif self._joint.is_moving and self._joint.is_revolute:
            parts = point @ self._carrying
            sine, cosine = np.sin(position)[:, None], np.cos(position)[:, None]
            turned = parts[:, :3] + sine * parts[:, 3:6] + cosine * parts[:, 6:]
        else:
            turned = point @ self._fixed.T
        if self._joint.is_moving and not self._joint.is_revolute:
            turned = turned + position[:, None] * self._way
        return turned + self._shift


def _matrix(rpy: Vector) -> np.ndarray:
    x, y, z, w = quat_of(rpy)
    return np.array(
        (
            (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
            (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
            (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
        )
    )
