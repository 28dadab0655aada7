"""The robot that is guarded: its joints, and where its links are."""

import math
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from custom_ros_tools.errors import ConfigError, Problem, UnknownNameError
from custom_ros_tools.transforms import matrix_of, quat_of
from rpbi.urdf.document import UrdfDocument
from rpbi.urdf.elements import UrdfJoint
from rpbi.urdf.structure import check_structure

MOST_JOINTS = 500
"""Joints that are not fixed; the time that finding out how they move takes grows with their square."""
MOST_OUTSIDE = 0.1
"""A telescopic joint starts at most so far outside its limits [rad or m]."""


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
        telescopic: Names of the guarded joints by which something slides in what others turn.
        still: Names of the joints that do not move, which joint states may have too.
        frames: Where its links are.

    Raises:
        ConfigError: If the description cannot be read or a joint makes no sense.
        UnknownNameError: If a joint is not known or does not move by itself.
    """

    def __init__(self, urdf_path: str, joint_names: Sequence[str] = ()) -> None:
        self.urdf_path = urdf_path
        self.document = document = UrdfDocument(urdf_path, not_xml="expected well-formed XML")
        check_structure(document)
        if (moving := sum(kind != "fixed" for kind in document.joint_types.values())) > MOST_JOINTS:
            message = f"expected at most {MOST_JOINTS} joints that are not fixed, got {moving}"
            raise ConfigError([Problem(urdf_path, "", message)])
        try:
            self._all = document.joints
        except ValueError as error:
            raise ConfigError([Problem(urdf_path, "", str(error))]) from None
        for name, joint in self._all.items():
            if joint.mimic is not None and joint.mimic.joint not in self._all:
                message = f"joint '{name}' mimics '{joint.mimic.joint}', which there is not"
                raise ConfigError([Problem(urdf_path, "", message)])
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
        self.telescopic = tuple(dict.fromkeys(name for link in self.links for name in self._telescopic_to(link)))
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
        frame, pose = self.frames.place(link)
        positions: np.ndarray = self.frames.at(q)[:, frame, :3] @ pose[:, 3]
        return positions

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

        Raises:
            ConfigError: If there is no limit to it.
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
            beyond += math.hypot(*joint.xyz)
            if joint.is_moving and not joint.is_revolute:
                beyond += self._travel(joint)
        if not np.isfinite(reach).all():
            name = self.joint_names[int(np.argmin(np.isfinite(reach)))]
            message = f"expected limits for what slides between joint '{name}', which turns it, and link '{link}'"
            raise ConfigError([Problem(self.urdf_path, "", message)])
        return reach

    def _travel(self, joint: UrdfJoint) -> float:
        """Returns how far from 0 a joint may be [rad or m]."""
        if joint.mimic is not None:
            leader = self._all[joint.mimic.joint]
            return abs(joint.mimic.multiplier) * self._travel(leader) + abs(joint.mimic.offset)
        if joint.name in self._index:
            return max(abs(joint.lower), abs(joint.upper)) + MOST_OUTSIDE
        return abs(float(self._positions(joint, np.zeros((1, 0)))[0]))

    def _telescopic_to(self, link: str) -> list[str]:
        """Returns the names of the guarded joints on the way to a link by which it slides in what others turn."""
        turned, telescopic = False, []
        for joint in self.chain(link):
            i = self._driver(joint)
            if i is not None and joint.is_revolute:
                turned = True
            elif i is not None and turned:
                telescopic.append(self.joint_names[i])
        return telescopic

    def _driver(self, joint: UrdfJoint) -> int | None:
        if not joint.is_moving:
            return None
        return self._index.get(joint.mimic.joint if joint.mimic else joint.name)


class LinkFrames:
    """Frames of what moves in one piece: frame 0 is the root, each other one that of a link below a joint that moves.

    Args:
        joints: All joints of the robot.
        coupling: Returns how some joints follow from the n guarded ones, see `GuardedRobot.coupling`.
    """

    def __init__(
        self, joints: Iterable[UrdfJoint], coupling: Callable[[Sequence[str]], tuple[np.ndarray, np.ndarray]]
    ) -> None:
        self._above = {joint.child: joint for joint in joints}
        moving = [joint for joint in self._above.values() if joint.is_moving]
        moving.sort(key=lambda joint: self._depth(joint.child))
        self._frame = {joint.child: i for i, joint in enumerate(moving, start=1)}
        self._factors, self._offsets = coupling([joint.name for joint in moving])
        parents = [self.place(joint.parent) for joint in moving]
        self._parents = [frame for frame, _ in parents]
        m = len(moving)
        self._fixed, self._way, self._sine, self._versine = np.zeros((4, m, 4, 4))
        for i, (joint, (_, parent)) in enumerate(zip(moving, parents)):
            fixed = self._fixed[i] = parent @ _origin(joint)
            if joint.is_revolute:  # after Rodrigues
                x, y, z = joint.axis
                cross = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))
                self._sine[i, :3, :3] = fixed[:3, :3] @ cross
                self._versine[i, :3, :3] = fixed[:3, :3] @ cross @ cross
            else:
                self._way[i, :3, 3] = fixed[:3, :3] @ joint.axis
        self._last = b"", np.empty((0, m + 1, 4, 4))

    def place(self, link: str) -> tuple[int, np.ndarray]:
        """Returns the number of the frame that a link moves with, and the pose of the link in it, 4 x 4."""
        pose = np.eye(4)
        while link in self._above and link not in self._frame:
            pose = _origin(self._above[link]) @ pose
            link = self._above[link].parent
        return self._frame.get(link, 0), pose

    def at(self, q: np.ndarray) -> np.ndarray:
        """Returns the m frames in the root in k configurations of n positions, k x m x 4 x 4; not to be changed."""
        key = q.tobytes()
        if key != self._last[0]:  # several checks ask for the same
            self._last = key, self._computed(q)
        return self._last[1]

    def _computed(self, q: np.ndarray) -> np.ndarray:
        angles = (q @ self._factors.T + self._offsets)[:, :, None, None]
        local = self._fixed + np.sin(angles) * self._sine + (1.0 - np.cos(angles)) * self._versine
        local += angles * self._way
        frames = np.empty((len(q), len(self._parents) + 1, 4, 4))
        frames[:, 0] = np.eye(4)
        for i, parent in enumerate(self._parents):
            np.matmul(frames[:, parent], local[:, i], out=frames[:, i + 1])
        return frames

    def _depth(self, link: str) -> int:
        depth = 0
        while link in self._above:
            link, depth = self._above[link].parent, depth + 1
        return depth


def _origin(joint: UrdfJoint) -> np.ndarray:
    return matrix_of(joint.xyz, quat_of(joint.rpy))
