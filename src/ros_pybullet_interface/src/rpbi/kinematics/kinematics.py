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
    """Computes forward and inverse kinematics of one robot, in a private PyBullet client.

    Any thread may call the methods; a lock admits one thread at a time. PyBullet holds Python's global interpreter lock
    for a few tenths of a millisecond at a time, never for a whole solution.

    Args:
        urdf_path: URDF file of the robot. Meshes in the file need not exist.
        scaling: PyBullet's `globalScaling` of the robot.
        flags: PyBullet's `flags` of `loadURDF`.

    Attributes:
        joint_names: Names of the n joints that motors can move, in the robot's order.
        limits: Position limits of these n joints.

    Raises:
        ConfigError: If the URDF cannot be read, is not well-formed, or does not describe a robot.
        PhysicsError: If PyBullet cannot load the robot.
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
            link_name: Name of the link, which is not the root link.

        Raises:
            UnknownNameError: If there is no such link.
            ValueError: If the number of positions is not n, a position is not finite, the link is the root link, or a
                joint above the link is not revolute, prismatic or fixed.
            PhysicsError: If `close` was called.
        """
        if len(positions) != len(self.joint_names) or not all(map(math.isfinite, positions)):
            expected = f"{len(self.joint_names)} finite values, one for each of {', '.join(self.joint_names)}"
            raise ValueError(f"positions: expected {expected}; got {list(positions)}")
        with self._open():
            chain = self._chain(link_name)
            chain.set(np.array(positions, dtype=float)[chain.members])
            return chain.pose()

    def solve(self, problem: PybulletProblem) -> PybulletSolution:
        """Searches for joint positions that move a link to a target. The result depends only on the problem.

        The search begins at `currentPosition`, continues from random starts until a solution is found, and is limited
        to a fixed number of iterations. With a rest posture, the search begins at the posture instead. The solution
        found is then changed to be as near to the posture as the target permits.

        Raises:
            UnknownNameError: If there is no such link.
            ValueError: If the length of a list is not the number of joints, limits exclude all positions of a joint,
                the link is the root link, or a joint above the link is not revolute, prismatic or fixed.
            PhysicsError: If `close` was called.
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
        """Locks the client for one thread during a `with` block; raises PhysicsError if the client was closed."""
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
        """Returns the chain from the root to a link, and loads it at the first call.

        Raises:
            UnknownNameError: If there is no such link.
            ValueError: If the link is the root link, or a joint above the link is not revolute, prismatic or fixed.
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
