"""Keys of a robot's YAML file."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Union

from pydantic import ConfigDict, Field, PlainValidator, ValidationInfo, WithJsonSchema, field_validator, model_validator

from custom_ros_tools.schema import (
    ConfigModel,
    Hz,
    HzOrOff,
    KeyedError,
    ListOf,
    Name,
    NonNegative,
    Seconds,
    Switch,
    Text,
)
from robot_model.urdf.elements import Mimic
from rpbi.bodies.body_config import BodyConfig
from rpbi.config.pybullet_models import LoadURDF, ObjectTf, ResetBaseVelocity, SetJointMotorControlArray
from rpbi.config.sensors import ContactsConfig, ForceTorqueEntry
from rpbi.control.controllers import CONTROLLERS, ControllerConfig
from rpbi.control.controllers.impedance import JointSprings
from rpbi.control.jitter_buffer import BUFFER_S
from rpbi.control.planar_base import PlanarBaseConfig
from rpbi.control.trajectories.config import JointTrajectoryControllerConfig

_NOT_VISUAL = {
    "controllers": "a visual robot has no motors to drive",
    "joint_trajectory_controller": "a visual robot has no motors",
    "contacts": "a visual robot has no contacts",
    "planar_base": "a visual robot has no physics; its base follows object_tf",
}


def controller_config(entry: Any, info: ValidationInfo) -> ControllerConfig:
    """Parses an entry of `controllers` with the `Config` of the controller class that the entry names."""
    expected = f"a mapping with 'type', one of {', '.join(CONTROLLERS)}, or module:Class"
    return CONTROLLERS.parse_entry(entry, info, ControllerConfig, expected)


class OwnControllerConfig(ControllerConfig):
    """An entry of `controllers` whose class another package defines, possibly with further keys."""

    model_config = ConfigDict(json_schema_extra={"additionalProperties": True})

    type: Annotated[Text, WithJsonSchema({"type": "string", "pattern": ":"})] = Field(description="`module:Class`.")


_Entry: Any = Union[(*CONTROLLERS.configs().values(), OwnControllerConfig)]  # noqa: UP007 (known at run time only)
ControllerEntry = Annotated[Any, PlainValidator(controller_config, json_schema_input_type=_Entry)]
"""A controller: `{type: KEY or module:Class, KEY: VALUE, ...}`."""


class CoupledJoint(ConfigModel):
    """A mimic joint, as `<mimic>` defines it in a URDF."""

    joint: Text = Field(description="The joint that it follows.")
    multiplier: float = Field(1.0, description="Its velocity over that of the other.")
    offset: float = Field(
        0.0, description="Its position where the other is at 0.", json_schema_extra={"unit": "rad or m"}
    )

    @field_validator("multiplier")
    @classmethod
    def _is_not_zero(cls, value: float) -> float:
        if value == 0.0:
            raise ValueError("must not be 0: the joint would never move")
        return value

    @property
    def mimic(self) -> Mimic:
        """The coupling in the form of a URDF's `<mimic>` element."""
        return Mimic(self.joint, self.multiplier, self.offset)


class RobotConfig(BodyConfig):
    """A robot, simulated or only shown."""

    loadURDF: LoadURDF = Field(description="Its description and where its base is.")
    inertia_from_urdf: Switch = Field(
        True, description="Whether moments of inertia are the URDF's, else PyBullet's guess from the collision shapes."
    )
    is_visual_robot: Switch = Field(
        False, description="Whether it is only visible: it follows joint targets and TF, without contacts."
    )
    setJointMotorControlArray: SetJointMotorControlArray | None = Field(
        None, description="Its motors; required unless it is a visual robot."
    )
    initial_joint_position: dict[str, float] = Field(
        {}, description="Start position by joint; those not named start at 0.", json_schema_extra={"unit": "deg or m"}
    )
    initial_revolute_joint_positions_are_deg: Switch = Field(
        True, description="Whether start positions of revolute joints are in degrees, else in radians."
    )
    initial_joint_state_topic: str | None = Field(
        None, description="Joint states, for instance of the real robot, to start at instead."
    )
    initial_joint_state_timeout_s: Seconds = Field(5.0, description="Longest wait for them, of wall time.")
    move_to_initial_joint_state_on_startup: Switch = Field(
        False, description="Accepted without effect: a robot starts there and its motors hold it."
    )
    coupled_joints: dict[str, CoupledJoint] = Field({}, description="Mimic joints by name, beside those of the URDF.")
    target_timeout_s: Seconds = Field(
        0.5, description="Age at which velocity and torque targets expire, in the world's time; positions never do."
    )
    target_interpolation: Literal["hold", "linear", "smooth"] = Field(
        "smooth",
        description="Interpolation of a stream of position targets: at once, at constant velocity, or with rounded "
        "corners.",
    )
    target_buffer_s: NonNegative = Field(
        BUFFER_S,
        description="Delay of position targets of a stream, for late ones; 0 plays targets on arrival.",
        json_schema_extra={"unit": "s"},
    )
    enforce_effort_limits: Switch = Field(True, description="Whether motors are held to the efforts of the URDF.")
    gravity_compensation: Switch = Field(
        False, description="Whether torque targets come on top of the torques that hold the robot against gravity."
    )
    joint_state_publisher_hz: HzOrOff = Field(50.0, description="Rate of the joint states; 0 is off.")
    broadcast_link_states: Switch = Field(False, description="Whether the poses of all links are on TF.")
    broadcast_link_states_hz: Hz = Field(50.0, description="Rate of the links' poses on TF.")
    broadcast_root_tf_hz: HzOrOff = Field(
        0.0, description="Rate of the root link's pose on TF if those of all links are not; 0 is off."
    )
    base_state_hz: HzOrOff | None = Field(
        None, description="Rate of the state of the base; 0 is off. By default 50 where physics moves it, else off."
    )
    planar_base: PlanarBaseConfig | None = Field(
        None, description="Makes the base drive over the ground by `cmd_vel`, with these limits."
    )
    enabled_joint_force_torque_sensors: ListOf[ForceTorqueEntry] = Field(
        (), description="Joints with a force-torque sensor: names, or mappings with all of its keys."
    )
    controllers: dict[Name, ControllerEntry] = Field(
        {}, description="Controllers that live in the tick, by name.", json_schema_extra={"additionalProperties": False}
    )
    impedance: JointSprings = Field(JointSprings(), description="Springs and dampers of IMPEDANCE_CONTROL.")
    joint_trajectory_controller: JointTrajectoryControllerConfig | None = Field(
        None, description="Follower of trajectories, for planners; {} has the usual settings."
    )
    object_tf: ObjectTf | None = Field(None, description="TF frame that a fixed or visual base follows.")
    resetBaseVelocity: ResetBaseVelocity | None = Field(None, description="Start velocity of a floating base.")
    do_log_joint_limit_violations: Switch = Field(
        True, description="Whether a visual robot that is beyond its joints' limits is reported."
    )
    log_joint_limit_violations_hz: Hz = Field(
        50.0, description="Accepted without effect: each violation is logged once."
    )
    start_ik_callback: Switch = Field(
        False, description="Whether it moves to the solutions of inverse kinematics problems on the topic `ik`."
    )
    strict: Switch = Field(
        False, description="Whether `ik` refuses targets out of reach; otherwise the link moves as near as possible."
    )
    contacts: ContactsConfig | None = Field(None, description="Its contacts, as topics; {} has the usual settings.")
    color_alpha: float | None = Field(None, ge=0.0, le=1.0, description="Opacity of the whole robot, 0 to 1.")

    @field_validator("setJointMotorControlArray")
    @classmethod
    def _has_motors_unless_visual(
        cls, value: SetJointMotorControlArray | None, info: ValidationInfo
    ) -> SetJointMotorControlArray | None:
        if value is None and not info.data.get("is_visual_robot"):
            raise KeyedError("setJointMotorControlArray", "missing; only a visual robot does without")
        return value

    @model_validator(mode="after")
    def _keys_go_together(self) -> RobotConfig:
        for key, message in _NOT_VISUAL.items() if self.is_visual_robot else ():
            if getattr(self, key) not in (None, {}):
                raise KeyedError(key, message)
        for index, sensor in enumerate(self.enabled_joint_force_torque_sensors):
            if not (sensor.hz or self.joint_state_publisher_hz):
                key = f"enabled_joint_force_torque_sensors[{index}].hz"
                raise KeyedError(key, "missing; the default is the rate of the joint states, which are off")
        if self.planar_base is not None:
            if self.resetBaseVelocity is not None:
                raise KeyedError("resetBaseVelocity", "a planar base starts at rest; remove this or planar_base")
            if self.loadURDF.useMaximalCoordinates:
                raise KeyedError("loadURDF.useMaximalCoordinates", "does not go with planar_base; remove one")
        return self
