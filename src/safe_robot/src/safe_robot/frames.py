"""Where the links of a robot are, in many configurations at once."""

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from custom_ros_tools.transforms import matrix_of, quat_of
from rpbi.urdf.document import UrdfJoint


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
