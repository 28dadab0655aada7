"""URDF objects: bodies with links and joints but without motors."""

import pybullet
from pydantic import Field

from custom_ros_tools.errors import ConfigError, Problem
from custom_ros_tools.schema import HzOrOff, Switch
from robot_model.urdf.document import UrdfDocument, mimics_of
from rpbi.config.pybullet_models import LoadURDF, ObjectTf, ResetBaseVelocity
from rpbi.config.sensors import ContactsConfig
from rpbi.engine.client import Client
from rpbi.sensors.base_state import BaseStateSensor
from rpbi.sensors.contacts.arrows import contact_sensors
from rpbi.sensors.link_pose import LinkPoseSensor
from rpbi.sensors.sensor import Sensor
from rpbi.urdf.joints import Joint, JointModel, couple
from rpbi.urdf.loading import load_urdf, prepared_urdf

from .body import Body
from .body_config import BodyConfig


class UrdfObjectConfig(BodyConfig):
    """An object that comes from a URDF and has no motors."""

    loadURDF: LoadURDF = Field(description="URDF file of the object, and pose of its base.")
    inertia_from_urdf: Switch = Field(
        True,
        description="Whether moments of inertia are taken from the URDF, otherwise computed by PyBullet from the "
        "collision shapes.",
    )
    object_tf: ObjectTf | None = Field(
        None, description="TF frame that a fixed base follows. By default, the base does not follow a frame."
    )
    resetBaseVelocity: ResetBaseVelocity | None = Field(
        None, description="Start velocity of a base that is not fixed. By default, the base starts at rest."
    )
    broadcast_hz: HzOrOff = Field(0.0, description="Rate of the poses of all links on TF; 0 is off.")
    base_state_hz: HzOrOff = Field(
        0.0, description="Rate of the root link's pose and velocity on `base_state`; 0 is off."
    )
    contacts: ContactsConfig | None = Field(
        None,
        description="Topics with the contacts of the object; `{}` selects the defaults. By default, contacts are not "
        "published.",
    )


class UrdfObject(Body):
    """A passive object that a robot can push or open, such as a cup, a door or a drawer.

    The joints move freely within their limits, except for the damping and friction in the `dynamics` of the URDF.

    Raises:
        ConfigError: If the URDF cannot be loaded.
        PhysicsError: If PyBullet does not create the body.
    """

    Config = UrdfObjectConfig
    section = "urdfs"
    example = {
        "loadURDF": {"fileName": "cube.urdf", "useFixedBase": True},
        "broadcast_hz": 50.0,
        "base_state_hz": 50.0,
        "contacts": {},
        "object_tf": {"tf_id": "FRAME"},
    }

    @classmethod
    def prepare(cls, config: UrdfObjectConfig, has_window: bool) -> None:
        """Prepares the files that PyBullet reads in place of the URDF."""
        prepared_urdf(config.loadURDF.kwargs(), has_window=has_window)

    def __init__(self, pb: Client, config: UrdfObjectConfig) -> None:
        _refuse_soft(config)
        arguments = config.loadURDF.kwargs()
        body_id = load_urdf(pb, config.name, arguments, inertia_from_urdf=config.inertia_from_urdf)
        super().__init__(pb, config.name, body_id)
        self.config = config
        self._couple()
        for index in self.joint_indices:
            self._release(index)
        # PyBullet fixes a base without mass.
        is_fixed = bool(config.loadURDF.useFixedBase) or pb.getDynamicsInfo(self.body_id, -1)[0] == 0.0
        self._start_base(config.resetBaseVelocity, config.object_tf, is_fixed)

    def sensors(self) -> tuple[Sensor, ...]:
        """Returns the sensors of the link poses, base state and contacts, each only if it is configured."""
        config = self.config
        sensors: list[Sensor] = []
        if config.broadcast_hz:
            sensors.append(LinkPoseSensor(self, config.broadcast_hz))
        if config.base_state_hz:
            sensors.append(BaseStateSensor(self, config.base_state_hz))
        return (*sensors, *contact_sensors(self, config.contacts))

    def _couple(self) -> None:
        """Couples the mimic joints of the URDF to the joints that they mimic.

        Raises:
            ConfigError: If a mimic joint cannot be coupled.
        """
        try:
            model = JointModel(Joint.all_of(self.pb, self.body_id), mimics=mimics_of(self.config.loadURDF.fileName))
        except ValueError as error:
            raise ConfigError([Problem(self.name, "loadURDF.fileName", str(error))]) from None
        for index, coupling in model.couplings.items():
            self.pb.resetJointState(self.body_id, index, coupling.offset)
        couple(self.pb, self.body_id, model.couplings)

    def _release(self, index: int) -> None:
        """Replaces a joint's motor by Coulomb friction, with the friction force or torque from the URDF.

        PyBullet adds a motor to each joint, and ignores joint friction in a URDF. A motor that holds velocity 0 with at
        most the friction force or torque acts as Coulomb friction.
        """
        info = self.pb.getJointInfo(self.body_id, index)
        kind, friction = info[2], info[7]
        if kind in (pybullet.JOINT_REVOLUTE, pybullet.JOINT_PRISMATIC):
            self.pb.setJointMotorControl2(
                self.body_id, index, pybullet.VELOCITY_CONTROL, targetVelocity=0.0, force=friction
            )
        elif kind == pybullet.JOINT_SPHERICAL:
            self.pb.setJointMotorControlMultiDof(
                self.body_id,
                index,
                pybullet.POSITION_CONTROL,
                targetPosition=(0.0, 0.0, 0.0, 1.0),
                targetVelocity=(0.0, 0.0, 0.0),
                positionGain=0.0,
                velocityGain=1.0,
                force=(friction, friction, friction),
            )


def _refuse_soft(config: UrdfObjectConfig) -> None:
    file = config.loadURDF.fileName
    try:
        is_soft = bool(UrdfDocument(file).deformable_meshes())
    except ConfigError:
        return  # loading it reports the error
    if is_soft:
        message = f"{file} has a <deformable>: soft bodies belong to the list `soft_objects`"
        raise ConfigError([Problem(config.name, "loadURDF.fileName", message)])
