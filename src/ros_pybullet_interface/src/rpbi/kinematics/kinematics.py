"""Forward and inverse kinematics of one robot."""

import math
import threading
import weakref
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
import pybullet

from custom_ros_tools.errors import PhysicsError, UnknownNameError
from robot_model.geometry import normalized
from robot_model.limits import Limits
from robot_model.urdf.copies import without_shapes
from robot_model.urdf.document import UrdfDocument
from robot_model.urdf.elements import MOVING
from robot_model.urdf.files import write_description
from robot_model.urdf.structure import check_structure
from rpbi.engine.client import Client
from rpbi.geometry import Pose
from rpbi.urdf.joints import Joint
from rpbi.urdf.loading import check_joints, flags_for

from .chain import BulletChain, Target
from .problem import PybulletProblem, PybulletSolution
from .search import Search


class Kinematics:
    """Forward and inverse kinematics of one robot, in a private PyBullet client with its base at the origin.

    Any thread may call it; a lock inside lets one in at a time. PyBullet holds Python's lock for a few tenths of a
    millisecond at a time, never for a whole solution.

    Args:
        urdf_path: The robot's description; the meshes it names need not be there.
        scaling: PyBullet's `globalScaling` of the robot.
        flags: PyBullet's `flags` of its `loadURDF`.

    Attributes:
        joint_names: The n joints that a motor can move, in the robot's order.
        limits: Their limits.

    Raises:
        ConfigError: If the description cannot be read, is not well-formed or makes no robot.
        PhysicsError: If PyBullet cannot load it.
    """

    def __init__(self, urdf_path: str, scaling: float = 1.0, flags: int = 0) -> None:
        self._document = UrdfDocument(urdf_path, not_xml="expected well-formed XML")
        check_structure(self._document)
        check_joints(urdf_path, self._document.root)
        self._scaling = scaling
        self._lock = threading.Lock()
        self._pb = Client(pybullet.DIRECT)
        self._disconnect = weakref.finalize(self, self._pb.disconnect)
        try:
            joints = self._load_joints(flags)
        except pybullet.error as error:
            self.close()
            raise PhysicsError(f"{urdf_path}: PyBullet cannot load its links and joints: {error}") from error
        self._links = [joint.link for joint in joints]
        driven = [joint for joint in joints if joint.is_driven]
        self.joint_names = tuple(joint.name for joint in driven)
        self.limits = Limits.of_joints(driven)
        self._chains: dict[str, BulletChain] = {}

    def close(self) -> None:
        """Disconnects the client; later calls raise a PhysicsError."""
        with self._lock:
            self._disconnect()

    def forward(self, positions: Sequence[float], link_name: str) -> Pose:
        """Returns the pose of a link's URDF frame in the frame of the base link.

        Args:
            positions: n positions [rad or m], in the order of `joint_names`.
            link_name: The link; not the root.

        Raises:
            UnknownNameError: If there is no such link.
            ValueError: If there are not n positions, or one is not finite.
            PhysicsError: If it was closed.
        """
        if len(positions) != len(self.joint_names) or not all(map(math.isfinite, positions)):
            expected = f"{len(self.joint_names)} finite values, one for each of {', '.join(self.joint_names)}"
            raise ValueError(f"positions: expected {expected}; got {list(positions)}")
        with self._open():
            chain = self._chain(link_name)
            chain.set(np.array(positions, dtype=float)[chain.members])
            return chain.pose()

    def solve(self, problem: PybulletProblem) -> PybulletSolution:
        """Searches joint positions that bring a link to a target; the same problem has the same answer.

        It returns the first solution from the given start, then from random ones, and stops after a fixed number of
        iterations. With a rest posture it starts there, and moves from the solution to the one nearest to the posture.

        Raises:
            UnknownNameError: If there is no such link.
            ValueError: If a list has not one value for each joint, limits leave a joint no position, or the link
                hangs on a joint that is neither revolute nor prismatic.
            PhysicsError: If it was closed.
        """
        problem.check_lengths(self.joint_names)
        limits = problem.narrowed(self.limits, self.joint_names)
        positions = np.zeros(len(self.joint_names))
        if start := problem.currentPosition or problem.resetPoses:
            positions[:] = start
        quat = problem.targetOrientation
        target = Target(problem.targetPosition, normalized(quat) if quat else None)
        with self._open():
            chain = self._chain(problem.link_name)
            search = Search(chain, target, limits.of(chain.members), problem, positions[chain.members].tolist())
            positions[chain.members], residual = search.run()
        return PybulletSolution(
            success=residual.size <= 1.0,
            message=residual.in_words(problem.link_name, bool(quat)),
            joint_names=self.joint_names,
            positions=tuple(positions.tolist()),
            chain=tuple(self.joint_names[i] for i in chain.members),
            position_error_m=residual.position_m,
            orientation_error_rad=residual.orientation_rad,
        )

    @contextmanager
    def _open(self) -> Iterator[None]:
        """Locks the client for one thread, or raises PhysicsError if it was closed."""
        with self._lock:
            if not self._disconnect.alive:
                raise PhysicsError("the robot was removed, and its kinematics with it")
            yield

    def _load_joints(self, flags: int) -> list[Joint]:
        """Returns all joints in the order in which PyBullet loads them."""
        pb = self._pb
        body_id = pb.loadURDF(
            write_description(without_shapes(self._document)),
            useFixedBase=True,
            globalScaling=self._scaling,
            flags=flags_for(len(self._document.edges), flags),
        )
        joints = Joint.all_of(pb, body_id)
        self._root_link = pb.getBodyInfo(body_id)[0].decode()
        pb.removeBody(body_id)
        return joints

    def _chain(self, link_name: str) -> BulletChain:
        """Returns the chain that moves a link.

        Raises:
            UnknownNameError: If there is no such link.
            ValueError: If it is the root link, or hangs on a joint that is neither revolute nor prismatic.
        """
        if link_name == self._root_link:
            raise ValueError(f"link_name: '{link_name}' is the root link, which no joint moves")
        if link_name not in self._links:
            raise UnknownNameError("link", link_name, self._links)
        if link_name not in self._chains:
            links = [link_name]
            for joint, kind, parent in self._document.joints_above(link_name):
                if kind not in (*MOVING, "fixed"):
                    only = "only revolute and prismatic ones are solved for"
                    raise ValueError(f"link_name: '{link_name}' hangs on '{joint}', a {kind} joint; {only}")
                links.append(parent)
            urdf = without_shapes(self._document, links)
            self._chains[link_name] = BulletChain(self._pb, urdf, self._scaling, link_name, self.joint_names)
        return self._chains[link_name]
