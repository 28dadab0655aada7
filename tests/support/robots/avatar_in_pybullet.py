"""An avatar that PyBullet moves: forward kinematics that know nothing of our own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pybullet
from pybullet_utils.bullet_client import BulletClient
from scipy.spatial.transform import Rotation

from operator_node.avatar.joints import HINGES
from operator_node.avatar.retargeting import AvatarPose
from operator_node.mvn.segments import SEGMENTS, SegmentFrame


class AvatarInPybullet:
    """A person in a PyBullet world of their own.

    Args:
        urdf: Text of the URDF.
        folder: Where it may be written.
    """

    def __init__(self, urdf: str, folder: Path) -> None:
        path = folder / "human.urdf"
        path.write_text(urdf)
        self.pb = BulletClient(pybullet.DIRECT)
        flags = pybullet.URDF_USE_INERTIA_FROM_FILE
        self.body = self.pb.loadURDF(str(path), useFixedBase=True, flags=flags)
        infos = [self.pb.getJointInfo(self.body, index) for index in range(self.pb.getNumJoints(self.body))]
        self.joints = {info[1].decode(): info[0] for info in infos}
        self.links = {"Pelvis": -1, **{info[12].decode(): info[0] for info in infos}}

    def put(self, pose: AvatarPose) -> None:
        """Puts base and joints somewhere."""
        centre = self.pb.getDynamicsInfo(self.body, -1)[3:5]
        self.pb.resetBasePositionAndOrientation(
            self.body, *self.pb.multiplyTransforms(pose.position, pose.quat_xyzw, *centre)
        )
        for hinge, value in zip(HINGES, pose.hinges):
            self.pb.resetJointState(self.body, self.joints[hinge], value)

    def frame(self) -> SegmentFrame:
        """Returns where the segments are."""
        poses = [self._pose(self.links[name]) for name in SEGMENTS]
        return SegmentFrame(0, 0, 0, np.array([pose[0] for pose in poses]), np.array([pose[1] for pose in poses]))

    def _pose(self, link: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
        if link >= 0:
            return self.pb.getLinkState(self.body, link, computeForwardKinematics=1)[4:6]
        centre = self.pb.invertTransform(*self.pb.getDynamicsInfo(self.body, -1)[3:5])
        return self.pb.multiplyTransforms(*self.pb.getBasePositionAndOrientation(self.body), *centre)


def largest_errors(a: SegmentFrame, b: SegmentFrame) -> tuple[float, float]:
    """Returns how far two people are apart: the segment that is farthest off [m], and that is turned most [deg]."""
    turns = Rotation.from_quat(a.quats_xyzw).inv() * Rotation.from_quat(b.quats_xyzw)
    off_m = float(np.linalg.norm(a.positions - b.positions, axis=1).max())
    return off_m, float(np.degrees(turns.magnitude()).max())
