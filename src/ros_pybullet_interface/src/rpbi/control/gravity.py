"""The torques that hold a robot against gravity."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rpbi.engine.client import Client
from rpbi.geometry import Vector
from rpbi.urdf.files import resolve_meshes

if TYPE_CHECKING:
    from rpbi.bodies.robots.jointed import JointedBody


class GravityModel:
    """Inverse dynamics of a robot at rest, in a client of its own.

    PyBullet's inverse dynamics take no notice of how the base stands; so the robot stands upright here, and gravity is
    turned instead.

    Args:
        robot: The robot. What is attached to it, or was changed in it since it was loaded, is not known here.
    """

    def __init__(self, robot: JointedBody) -> None:
        self._robot = robot
        self._driven = [joint.index for joint in robot.model.driven]
        self._zeros = [0.0] * len(self._driven)
        world = robot.pb.getPhysicsEngineParameters()
        self._gravity = tuple(world[f"gravityAcceleration{axis}"] for axis in "XYZ")
        self._gravity_in_base: Vector | None = None
        self._pb: Client | None = None  # made when it is needed first: the renderer's copy of the robot never does
        self._body_id = -1

    def efforts(self) -> dict[int, float]:
        """Returns the efforts [N m or N] by joint index that balance gravity where the robot is."""
        if not self._driven:
            return {}
        if self._pb is None:
            self._pb = self._load()
        quat = self._robot.base_pose().quat_xyzw
        gravity = self._pb.rotateVector(self._pb.invertTransform((0.0, 0.0, 0.0), quat)[1], self._gravity)
        if gravity != self._gravity_in_base:
            self._pb.setGravity(*gravity)
            self._gravity_in_base = gravity
        positions = list(self._robot.joint_positions().values())
        torques = self._pb.calculateInverseDynamics(self._body_id, positions, self._zeros, self._zeros)
        return dict(zip(self._driven, torques))

    def close(self) -> None:
        """Gives its client back."""
        if self._pb is not None:
            self._pb.disconnect()
            self._pb = None

    def _load(self) -> Client:
        pb = Client()
        arguments = self._robot.config.loadURDF.kwargs()
        for key in ("basePosition", "baseOrientation", "useFixedBase", "useMaximalCoordinates"):
            arguments.pop(key, None)
        arguments["fileName"] = resolve_meshes(arguments["fileName"])
        self._body_id = pb.loadURDF(**arguments, useFixedBase=True)
        return pb
