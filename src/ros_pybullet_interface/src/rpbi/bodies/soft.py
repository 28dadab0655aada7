"""Soft bodies: cloth and deformable solids."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pybullet
from pydantic import Field, model_validator

from custom_ros_tools.errors import ConfigError, InterfaceError, PhysicsError, Problem
from custom_ros_tools.schema import HzOrOff, KeyedError, ListOf
from robot_model.urdf.document import UrdfDocument
from rpbi.config.pybullet_models import AnchorEntry, ChangeVisualShape, CreateSoftBodyAnchor, LoadSoftBody, LoadURDF
from rpbi.config.sensors import ContactsConfig
from rpbi.engine.client import Client
from rpbi.geometry import Pose, Twist
from rpbi.meshes.checks import soft_mesh_problems
from rpbi.meshes.trial import Mesh, Use, faults_in
from rpbi.samples import BodyState
from rpbi.sensors.contacts.arrows import contact_sensors
from rpbi.sensors.sensor import Sensor
from rpbi.sensors.surface import SurfaceSensor
from rpbi.urdf.loading import load_urdf, prepared_urdf

from .body import Body
from .body_config import BodyConfig
from .dynamics import link_index


class SoftObjectConfig(BodyConfig):
    """A soft body, which deforms."""

    loadSoftBody: LoadSoftBody | None = Field(
        None, description="Mesh, start pose and material of the body. Either this key or `loadURDF` is required."
    )
    loadURDF: LoadURDF | None = Field(
        None, description="URDF file with a `<deformable>` element. Either this key or `loadSoftBody` is required."
    )
    createSoftBodyAnchor: ListOf[AnchorEntry] = Field(
        (), description="Mesh vertices that are tied to bodies or to the world, each as [node, body, link, position]."
    )
    changeVisualShape: ChangeVisualShape | None = Field(
        None, description="Colours of the body. By default, PyBullet's colours."
    )
    surface_hz: HzOrOff = Field(20.0, description="Rate of the surface markers for RViz; 0 is off.")
    contacts: ContactsConfig | None = Field(
        None,
        description="Topics with the contacts of the body; `{}` selects the defaults. By default, contacts are not "
        "published.",
    )

    @model_validator(mode="after")
    def _comes_from_one_place(self) -> SoftObjectConfig:
        if self.loadSoftBody is None and self.loadURDF is None:
            raise KeyedError("loadSoftBody", "missing; a soft body needs it, or loadURDF")
        if self.loadSoftBody is not None and self.loadURDF is not None:
            raise KeyedError("loadURDF", "does not go with loadSoftBody: remove one")
        return self


class SoftObject(Body):
    """A deformable body, in a world that is configured for soft bodies.

    The base pose is the mean position and rotation of the mesh nodes. PyBullet does not report a correct velocity, and
    replays do not reproduce the motion.

    Raises:
        ConfigError: If the mesh cannot be loaded, or the world is not configured for soft bodies.
        PhysicsError: If PyBullet does not create the body.
    """

    Config = SoftObjectConfig
    section = "soft_objects"
    is_soft = True
    example = {"loadSoftBody": {"fileName": "cloth_z_up.obj", "useMassSpring": True}, "contacts": {}}

    @classmethod
    def prepare(cls, config: SoftObjectConfig, has_window: bool) -> None:
        """If the body comes from a URDF, prepares the files that PyBullet reads instead of the URDF."""
        if config.loadURDF is not None:
            prepared_urdf(config.loadURDF.kwargs(), has_window=has_window)

    def __init__(self, pb: Client, config: SoftObjectConfig) -> None:
        if not pb.is_deformable:
            message = "soft bodies need resetSimulation: {flags: RESET_USE_DEFORMABLE_WORLD} in the main file"
            raise ConfigError([Problem(config.name, "", message)])
        super().__init__(pb, config.name, _load(pb, config))
        self.config = config
        self.inertial_pose_in_base = self._base_pose_in_inertial = Pose()  # PyBullet's value is meaningless
        # A sleeping soft body does not react to contacts, and bodies that follow poses would pass through it.
        pb.changeDynamics(self.body_id, -1, activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING)
        self._anchors: list[tuple[str | None, int]] = []
        """For each anchor, the name of the body that it ties to (None for the world), and PyBullet's id of the anchor.
        """
        if config.changeVisualShape is not None:
            pb.changeVisualShape(self.body_id, -1, **config.changeVisualShape.kwargs())

    def attach(self, bodies: Mapping[str, Body]) -> None:
        """Creates the configured anchors.

        Raises:
            ConfigError: If an anchor names a soft body, or a body, link or node that does not exist. All anchors are
                then removed again.
        """
        problems = []
        for index, anchor in enumerate(self.config.createSoftBodyAnchor):
            try:
                self._anchors.append((anchor.body, self._anchor(anchor, bodies)))
            except (InterfaceError, ValueError, pybullet.error) as error:
                problems.append(Problem(self.name, f"createSoftBodyAnchor[{index}]", str(error)))
        if problems:
            self.detach()
            raise ConfigError(problems)

    def detach(self, name: str | None = None) -> None:
        """Removes the anchors to the body with a given name, or all anchors if `name` is None."""
        for body, anchor_id in self._anchors:
            if name is None or body == name:
                self.pb.removeConstraint(anchor_id)
        self._anchors = [each for each in self._anchors if name is not None and each[0] != name]

    def sensors(self) -> tuple[Sensor, ...]:
        """Returns the sensors of the surface and of the contacts, each only if it is configured."""
        surface = (SurfaceSensor(self, self.config.surface_hz),) if self.config.surface_hz else ()
        return surface + contact_sensors(self, self.config.contacts)

    def base_twist(self) -> Twist:
        """Raises an error, since the velocity that PyBullet reports for soft bodies is wrong.

        Raises:
            PhysicsError: Always.
        """
        raise PhysicsError(f"{self.name}: a soft body has no twist")

    def motion_state(self) -> tuple[float, ...]:
        """Returns an empty tuple, since the motion of soft bodies is not deterministic."""
        return ()

    def state(self) -> BodyState:
        """Returns the base pose, and the positions of the nodes of the simulated mesh."""
        position, quat = self.pb.getBasePositionAndOrientation(self.body_id)
        _, nodes = self.pb.getMeshData(self.body_id, -1, flags=pybullet.MESH_DATA_SIMULATION_MESH)
        return BodyState(self.name, position + quat, (), nodes)

    def remove(self) -> None:
        """Removes the anchors, then the body, from the world."""
        self.detach()
        super().remove()

    def _anchor(self, anchor: CreateSoftBodyAnchor, bodies: Mapping[str, Body]) -> int:
        count, _ = self.pb.getMeshData(self.body_id, -1, flags=pybullet.MESH_DATA_SIMULATION_MESH)
        if anchor.node >= count:
            raise ValueError(f"expected a node from 0 to {count - 1}, got {anchor.node}")
        if anchor.body is None:
            return int(self.pb.createSoftBodyAnchor(self.body_id, anchor.node, -1, -1))
        if anchor.body not in bodies or bodies[anchor.body].is_soft:
            known = ", ".join(name for name, each in bodies.items() if not each.is_soft)
            raise ValueError(f"expected the name of a rigid body that is there already, got '{anchor.body}': {known}")
        body = bodies[anchor.body]
        if isinstance(anchor.link, str):
            link = link_index(body, anchor.link)
        elif anchor.link < len(body.joint_indices):
            link = anchor.link
        else:
            count = len(body.joint_indices)
            raise ValueError(f"'{body.name}' has {count} links in addition to the base, got {anchor.link}")
        return int(self.pb.createSoftBodyAnchor(self.body_id, anchor.node, body.body_id, link))


def _load(pb: Client, config: SoftObjectConfig) -> int:
    """Loads a soft body and returns PyBullet's id of the body."""
    if (load := config.loadSoftBody) is not None:
        if load.useNeoHookean and Path(load.simFileName or load.fileName).suffix.lower() != ".vtk":
            message = "a solid needs tetrahedra (.vtk); for a surface use useMassSpring"
            raise ConfigError([Problem(config.name, "loadSoftBody.useNeoHookean", message)])
        try:
            return int(pb.loadSoftBody(**load.kwargs()))
        except pybullet.error as error:
            raise ConfigError([Problem(config.name, "loadSoftBody", f"PyBullet could not load it: {error}")]) from None
    assert config.loadURDF is not None  # the model demands one of both
    urdf = config.loadURDF.fileName
    files = UrdfDocument(urdf).deformable_meshes()
    messages = [message for mesh in files for message in soft_mesh_problems(mesh)]
    messages = messages or list(faults_in(Mesh(Use.SOFT, mesh) for mesh in files).values())
    if not files:
        messages = [f"{urdf}: expected a <deformable> with a mesh; rigid objects belong to the list `urdfs`"]
    if messages:
        raise ConfigError([Problem(config.name, "loadURDF.fileName", message) for message in messages])
    return load_urdf(pb, config.name, config.loadURDF.kwargs())
