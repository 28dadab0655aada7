"""Every library that moves robots, held to the conformance suite."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from custom_ros_tools.transforms import pose_of
from robot_model.chain import Chain
from robot_model.conformance import Backend, BackendConformance
from robot_model.geometry import Pose
from robot_model.limits import Limits
from robot_model.model import RobotModel

KUKA = str(Path(__file__).resolve().parents[3] / "src/rpbi_examples/robots/kuka_lwr.urdf")


class OfRobotModel(Backend):
    def __init__(self, path: str) -> None:
        self.robot = RobotModel(path)
        self.joint_names, self.limits = self.robot.joint_names, self.robot.limits

    def pose(self, q: Sequence[float], link: str) -> Pose:
        return self.robot.pose(q, link)

    def jacobian(self, q: Sequence[float], link: str) -> np.ndarray:
        return self.robot.frames.jacobian(np.array([q]), link)[0]


class TestRobotModel(BackendConformance):
    robots = (KUKA,)

    def make(self, urdf_path: str) -> Backend:
        return OfRobotModel(urdf_path)


class OfPybullet(Backend):
    def __init__(self, path: str) -> None:
        from rpbi.control.robot_dynamics import RobotDynamics
        from rpbi.engine.client import Client
        from rpbi.urdf.joints import Joint, JointModel

        pb = Client()
        joints = Joint.all_of(pb, pb.loadURDF(path, useFixedBase=True))
        model = JointModel(joints, mimics=RobotModel(path).document.mimics)
        self.joint_names = [joint.name for joint in model.driven]
        self.limits = Limits.of_joints(model.driven)
        self.index = {joint.link: joint.index for joint in joints}
        load = SimpleNamespace(kwargs=lambda: {"fileName": path})
        self.dynamics = RobotDynamics(pb, model, load, inertia_from_urdf=True)

    def pose(self, q: Sequence[float], link: str) -> Pose:
        return self.dynamics.pose(Pose(), q, self.index[link])

    def jacobian(self, q: Sequence[float], link: str) -> np.ndarray:
        return self.dynamics.jacobian(Pose(), q, self.index[link])


class TestPybullet(BackendConformance):
    """PyBullet reports poses in single precision."""

    robots = (KUKA,)
    tolerance = 2e-6
    step = 1e-2

    def make(self, urdf_path: str) -> Backend:
        return OfPybullet(urdf_path)


class OfChains(Backend):
    """A library of chains, from the root to each link."""

    def __init__(self, path: str) -> None:
        self.robot = RobotModel(path)
        self.joint_names, self.limits = self.robot.joint_names, self.robot.limits

    def chain(self, link: str) -> Chain:
        return Chain(self.robot.urdf_path, self.robot.root, link)

    def columns(self, chain: Chain) -> list[int]:
        return [self.joint_names.index(name) for name in chain.joint_names]

    def embedded(self, jacobian: np.ndarray, chain: Chain) -> np.ndarray:
        whole = np.zeros((6, len(self.joint_names)))
        whole[:, self.columns(chain)] = jacobian
        return whole


class OfKdl(OfChains):
    def pose(self, q: Sequence[float], link: str) -> Pose:
        from ik_ros.chain.kdl import KdlChain

        chain = self.chain(link)
        return KdlChain(chain).pose([q[i] for i in self.columns(chain)])

    def jacobian(self, q: Sequence[float], link: str) -> np.ndarray:
        from ik_ros.chain.kdl import KdlChain

        chain = self.chain(link)
        return self.embedded(KdlChain(chain).jacobian([q[i] for i in self.columns(chain)]), chain)


class TestKdl(BackendConformance):
    robots = (KUKA,)

    def make(self, urdf_path: str) -> Backend:
        return OfKdl(urdf_path)


class OfPinocchio(Backend):
    def __init__(self, path: str) -> None:
        from ik_ros.tasks.robot import PinocchioRobot

        self.robot = PinocchioRobot(path)
        self.joint_names, self.limits = self.robot.joint_names, self.robot.limits

    def _at(self, q: Sequence[float]) -> None:
        self.robot.update(self.robot.configuration(dict(zip(self.joint_names, q))))

    def pose(self, q: Sequence[float], link: str) -> Pose:
        self._at(q)
        position, quat = pose_of(self.robot.frame(self.robot.link_id(link)).homogeneous)
        return Pose(tuple(position.tolist()), tuple(quat.tolist()))

    def jacobian(self, q: Sequence[float], link: str) -> np.ndarray:
        self._at(q)
        number = self.robot.link_id(link)
        turn = self.robot.frame(number).rotation
        local = self.robot.jacobian(number)
        return np.concatenate((turn @ local[:3], turn @ local[3:]))


class TestPinocchio(BackendConformance):
    robots = (KUKA,)
    follows_mimics = False

    def make(self, urdf_path: str) -> Backend:
        pytest.importorskip("pinocchio")
        return OfPinocchio(urdf_path)


class OfCasadi(OfChains):
    def _frame(self, link: str):
        import casadi

        from ik_ros.chain.symbolic import link_frames

        chain = self.chain(link)
        q = casadi.SX.sym("q", len(chain.joint_names))
        rotation, position = link_frames(chain, q)[link]
        moved = casadi.jacobian(casadi.vertcat(position, casadi.reshape(rotation, 9, 1)), q)
        return chain, casadi.Function("frame", [q], [rotation, position, moved])

    def pose(self, q: Sequence[float], link: str) -> Pose:
        chain, frame = self._frame(link)
        rotation, position, _ = frame([q[i] for i in self.columns(chain)])
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = np.array(rotation), np.array(position).ravel()
        found, quat = pose_of(T)
        return Pose(tuple(found.tolist()), tuple(quat.tolist()))

    def jacobian(self, q: Sequence[float], link: str) -> np.ndarray:
        chain, frame = self._frame(link)
        rotation, _, moved = map(np.array, frame([q[i] for i in self.columns(chain)]))
        spins = [column.reshape(3, 3).T @ rotation.T for column in moved[3:].T]
        angular = np.array([(spin[2, 1], spin[0, 2], spin[1, 0]) for spin in spins]).T
        return self.embedded(np.concatenate((moved[:3], angular)), chain)


class TestCasadi(BackendConformance):
    robots = (KUKA,)
    follows_mimics = False

    def make(self, urdf_path: str) -> Backend:
        pytest.importorskip("casadi")
        return OfCasadi(urdf_path)
