"""The torques that hold a robot against gravity."""

from collections.abc import Mapping

from rpbi.config.pybullet_models import LoadURDF
from rpbi.engine.client import Client
from rpbi.geometry import Pose, Vector
from rpbi.urdf.files import resolve_meshes
from rpbi.urdf.joints import JointModel


class GravityModel:
    """Inverse dynamics of a robot at rest, in a client of its own.

    PyBullet's inverse dynamics take no notice of how the base stands; so the robot stands upright here, and gravity is
    turned instead.

    Args:
        world: The client of its world, for that one's gravity.
        load: How it was loaded. What is attached to it, or was changed in it since, is not known here.
    """

    def __init__(self, world: Client, model: JointModel, load: LoadURDF) -> None:
        self._load_arguments = load.kwargs()
        self._driven = [joint.index for joint in model.driven]
        self._zeros = [0.0] * len(self._driven)
        self._world = world
        self._gravity_in_base: Vector | None = None
        self._pb: Client | None = None  # made when it is needed first: the renderer's copy of the robot never does
        self._body_id = -1

    def efforts(self, base: Pose, positions: Mapping[int, float]) -> dict[int, float]:
        """Returns the efforts [N m or N] by joint index that balance gravity.

        Args:
            base: Pose of the root link in the world.
            positions: Positions [rad or m] of the driven joints by index, in the order of the model.
        """
        if not self._driven:
            return {}
        if self._pb is None:
            self._pb = self._load()
        to_base = self._pb.invertTransform((0.0, 0.0, 0.0), base.quat_xyzw)[1]
        gravity = self._pb.rotateVector(to_base, self._world.gravity)
        if gravity != self._gravity_in_base:
            self._pb.setGravity(*gravity)
            self._gravity_in_base = gravity
        torques = self._pb.calculateInverseDynamics(self._body_id, list(positions.values()), self._zeros, self._zeros)
        return dict(zip(self._driven, torques))

    def close(self) -> None:
        """Gives its client back."""
        if self._pb is not None:
            self._pb.disconnect()
            self._pb = None

    def _load(self) -> Client:
        pb = Client()
        file = resolve_meshes(self._load_arguments["fileName"])
        kept = {key: self._load_arguments[key] for key in ("flags", "globalScaling") if key in self._load_arguments}
        self._body_id = pb.loadURDF(file, useFixedBase=True, **kept)
        return pb
