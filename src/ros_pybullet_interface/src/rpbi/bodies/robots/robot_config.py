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

    type: Annotated[Text, WithJsonSchema({"type": "string", "pattern": ":"})] = Field(
        description="Class of the controller, as `module:Class`."
    )


_Entry: Any = Union[(*CONTROLLERS.configs().values(), OwnControllerConfig)]  # noqa: UP007 (known at run time only)
ControllerEntry = Annotated[Any, PlainValidator(controller_config, json_schema_input_type=_Entry)]
"""A controller: `{type: KEY or module:Class, KEY: VALUE, ...}`."""


class CoupledJoint(ConfigModel):
    """A mimic joint, as `<mimic>` defines it in a URDF."""

    joint: Text = Field(description="Name of the joint that this joint follows.")
    multiplier: float = Field(1.0, description="Ratio of this joint's velocity to the followed joint's velocity.")
    offset: float = Field(
        0.0,
        description="Position of this joint when the followed joint is at 0.",
        json_schema_extra={"unit": "rad or m"},
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

    loadURDF: LoadURDF = Field(description="URDF file of the robot, and pose of its base.")
    inertia_from_urdf: Switch = Field(
        True,
        description="Whether moments of inertia are taken from the URDF, otherwise computed by PyBullet from the "
        "collision shapes.",
    )
    is_visual_robot: Switch = Field(
        False, description="Whether the robot is only displayed: it follows joint targets and TF, and has no contacts."
    )
    setJointMotorControlArray: SetJointMotorControlArray | None = Field(
        None, description="Control mode and gains of the motors; required unless `is_visual_robot` is true."
    )
    initial_joint_position: dict[str, float] = Field(
        {},
        description="Start positions, keyed by joint name. All other joints start at 0.",
        json_schema_extra={"unit": "deg or m"},
    )
    initial_revolute_joint_positions_are_deg: Switch = Field(
        True, description="Whether start positions of revolute joints are in degrees, otherwise in radians."
    )
    initial_joint_state_topic: str | None = Field(
        None,
        description="Topic of joint states, for instance of a real robot, whose positions replace "
        "`initial_joint_position`. By default, only `initial_joint_position` is used.",
    )
    initial_joint_state_timeout_s: Seconds = Field(
        5.0, description="Longest wait for a message on `initial_joint_state_topic`, in wall time."
    )
    move_to_initial_joint_state_on_startup: Switch = Field(
        False,
        description="Accepted without effect: joints are at their start positions at once, and motors hold them there.",
    )
    coupled_joints: dict[str, CoupledJoint] = Field(
        {}, description="Mimic joints in addition to those of the URDF, keyed by joint name."
    )
    target_timeout_s: Seconds = Field(
        0.5,
        description="Age at which velocity and torque targets expire, in simulated time; position targets do not "
        "expire.",
    )
    target_interpolation: Literal["hold", "linear", "smooth"] = Field(
        "smooth",
        description="Motion between the position targets of a stream: `hold` jumps to each target, `linear` moves at "
        "constant velocity, and `smooth` also rounds the corners.",
    )
    target_buffer_s: NonNegative = Field(
        BUFFER_S,
        description="Delay of streamed position targets, so that a target may arrive late by up to this time; 0 "
        "applies each target on arrival.",
        json_schema_extra={"unit": "s"},
    )
    enforce_effort_limits: Switch = Field(
        True, description="Whether motor efforts are limited to the effort limits in the URDF."
    )
    gravity_compensation: Switch = Field(
        False, description="Whether torque targets are added to the torques that compensate gravity."
    )
    joint_state_publisher_hz: HzOrOff = Field(50.0, description="Rate of the joint states; 0 is off.")
    broadcast_link_states: Switch = Field(False, description="Whether the poses of all links are published on TF.")
    broadcast_link_states_hz: Hz = Field(50.0, description="Rate of the link poses on TF.")
    broadcast_root_tf_hz: HzOrOff = Field(
        0.0, description="Rate of the root link's pose on TF if `broadcast_link_states` is false; 0 is off."
    )
    base_state_hz: HzOrOff | None = Field(
        None,
        description="Rate of the base's pose and velocity on `base_state`; 0 is off. By default, 50 for a base that "
        "is not fixed, otherwise 0.",
    )
    planar_base: PlanarBaseConfig | None = Field(
        None,
        description="Limits of a base that drives over the ground as commanded on `cmd_vel`. By default, the base "
        "does not drive.",
    )
    enabled_joint_force_torque_sensors: ListOf[ForceTorqueEntry] = Field(
        (), description="Force-torque sensors in joints: joint names, or mappings with the keys of a sensor."
    )
    controllers: dict[Name, ControllerEntry] = Field(
        {},
        description="Controllers that run inside the tick, keyed by controller name.",
        json_schema_extra={"additionalProperties": False},
    )
    impedance: JointSprings = Field(
        JointSprings(), description="Springs and dampers of the control mode IMPEDANCE_CONTROL."
    )
    joint_trajectory_controller: JointTrajectoryControllerConfig | None = Field(
        None,
        description="Follower of joint trajectories; `{}` selects the defaults. By default, the robot does not "
        "accept trajectories.",
    )
    object_tf: ObjectTf | None = Field(
        None,
        description="TF frame that the base follows, if the base is fixed or the robot is visual. By default, the "
        "base does not follow a frame.",
    )
    resetBaseVelocity: ResetBaseVelocity | None = Field(
        None, description="Start velocity of a base that is not fixed. By default, the base starts at rest."
    )
    do_log_joint_limit_violations: Switch = Field(
        True, description="Whether a warning is logged when a joint of a visual robot exceeds its limits."
    )
    log_joint_limit_violations_hz: Hz = Field(
        50.0, description="Accepted without effect: each violation is logged once."
    )
    start_ik_callback: Switch = Field(
        False, description="Whether the robot moves to the solutions of inverse kinematics problems on its topic `ik`."
    )
    strict: Switch = Field(
        False,
        description="Whether unreachable targets on the topic `ik` are refused; otherwise the link moves as near as "
        "possible.",
    )
    contacts: ContactsConfig | None = Field(
        None,
        description="Topics with the contacts of the robot; `{}` selects the defaults. By default, contacts are not "
        "published.",
    )
    color_alpha: float | None = Field(
        None, ge=0.0, le=1.0, description="Opacity of the whole robot, from 0 to 1. By default, as in the URDF."
    )

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
