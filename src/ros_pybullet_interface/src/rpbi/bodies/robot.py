"""Robots: jointed bodies that hold and follow joint targets."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import pybullet
from pydantic import Field, model_validator

from custom_ros_tools.errors import ConfigError, Problem, UnknownNameError
from custom_ros_tools.schema import ConfigModel, Hz, KeyedError, Name

from ..client import Client
from ..inputs import Input
from ..joint_model import Joint, JointModel
from ..pybullet_models import LoadURDF, ResetBaseVelocity, SetJointMotorControlArray
from ..sensors.joint_state import JointStateSensor
from ..sensors.link_pose import LinkPoseSensor
from ..sensors.sensor import Sensor
from ..urdf import resolve_meshes
from .body import Body
from .urdf_faults import urdf_faults


class RobotConfig(ConfigModel):
    """YAML of a robot."""

    name: Name = Field(description="Unique name; topics and TF frames are named after it.")
    loadURDF: LoadURDF = Field(description="Its description and where its base is.")
    setJointMotorControlArray: SetJointMotorControlArray = Field(description="How its motors follow targets.")
    initial_joint_position: dict[str, float] = Field(
        {}, description="Start position by joint; those not named start at 0.", json_schema_extra={"unit": "deg or m"}
    )
    initial_revolute_joint_positions_are_deg: bool = Field(
        True, description="Whether start positions of revolute joints are in degrees, else in radians."
    )
    enforce_effort_limits: bool = Field(True, description="Whether motors are held to the efforts of the URDF.")
    joint_state_publisher_hz: Hz = Field(50.0, description="Rate of the joint states.")
    broadcast_link_states: bool = Field(False, description="Whether the poses of all links are on TF.")
    broadcast_link_states_hz: Hz = Field(50.0, description="Rate of the links' poses on TF.")
    resetBaseVelocity: ResetBaseVelocity | None = Field(None, description="Start velocity of a floating base.")
    color_alpha: float | None = Field(None, ge=0.0, le=1.0, description="Opacity of the whole robot, 0 to 1.")

    @model_validator(mode="after")
    def _is_position_controlled(self) -> RobotConfig:
        if self.setJointMotorControlArray.controlMode != pybullet.POSITION_CONTROL:
            raise KeyedError("setJointMotorControlArray.controlMode", "only POSITION_CONTROL is there yet")
        return self


class Robot(Body):
    """A robot under position control, within the effort and velocity limits of its URDF.

    It holds its start position until the first target, and every target until the next.

    Raises:
        ConfigError: If the configuration does not fit the robot.
        PhysicsError: If PyBullet cannot load it.
    """

    Config = RobotConfig
    section = "robots"

    def __init__(self, pb: Client, config: RobotConfig) -> None:
        super().__init__(pb, config.name, _load(pb, config))
        self.config = config
        self.model = JointModel([Joint.from_info(pb.getJointInfo(self.body_id, i)) for i in self.joint_indices])
        self.joints = self.model.joints
        self.root_link: str = pb.getBodyInfo(self.body_id)[0].decode()
        self._check_fit()
        start = self._start_positions()
        self._motor_arguments = {joint.index: self._motor(joint) for joint in self.model.driven}
        for index, position in start.items():
            pb.resetJointState(self.body_id, index, position)
        self._follow(start)
        if config.resetBaseVelocity is not None:
            pb.resetBaseVelocity(self.body_id, **config.resetBaseVelocity.kwargs())
        if config.color_alpha is not None:
            self._set_alpha(config.color_alpha)

    def sensors(self) -> tuple[Sensor, ...]:
        """Joint states, and link poses if they are to be broadcast."""
        joint_states = JointStateSensor(self, self.config.joint_state_publisher_hz)
        if not self.config.broadcast_link_states:
            return (joint_states,)
        return joint_states, LinkPoseSensor(self, self.config.broadcast_link_states_hz)

    def inputs(self) -> Mapping[str, Input]:
        """Takes `target`, a JointTarget of positions [rad or m]."""
        return {"target": Input(self.model.resolve, self._follow, merge=dict.__or__)}

    def _follow(self, positions: Mapping[int, float]) -> None:
        """Sets the motors' set points [rad or m] by joint index; PyBullet keeps them until they are set again."""
        for index, position in positions.items():
            self.pb.setJointMotorControl2(
                self.body_id, index, targetPosition=position, **self._motor_arguments[index]
            )

    def _motor(self, joint: Joint) -> dict[str, Any]:
        """Returns what PyBullet's motor of a joint is told beside its set point."""
        arguments: dict[str, Any] = {"controlMode": pybullet.POSITION_CONTROL}
        if self.config.enforce_effort_limits and math.isfinite(joint.max_effort):
            arguments["force"] = joint.max_effort
        if math.isfinite(joint.max_velocity):
            arguments["maxVelocity"] = joint.max_velocity
        motors = self.config.setJointMotorControlArray
        for argument, gains in (("positionGain", motors.positionGains), ("velocityGain", motors.velocityGains)):
            if gains is not None:
                arguments[argument] = gains[self.model.driven.index(joint) % len(gains)]
        return arguments

    def _check_fit(self) -> None:
        """Finds what in the configuration does not fit the robot.

        Raises:
            ConfigError: If something does not; it tells all of it.
        """
        problems = []
        for name in self.config.initial_joint_position:
            try:
                self.model[name]
            except UnknownNameError as error:
                problems.append(Problem(self.name, f"initial_joint_position.{name}", str(error)))
        motors = self.config.setJointMotorControlArray
        expected = f"expected 1 number or {len(self.model.driven)}"
        for key, gains in (("positionGains", motors.positionGains), ("velocityGains", motors.velocityGains)):
            if gains is not None and len(gains) not in (1, len(self.model.driven)):
                names = ", ".join(driven.name for driven in self.model.driven)
                message = f"{expected}, one for each of {names}; got {len(gains)}"
                problems.append(Problem(self.name, f"setJointMotorControlArray.{key}", message))
        if problems:
            raise ConfigError(problems)

    def _start_positions(self) -> dict[int, float]:
        """Returns the start position [rad or m] of each driven joint by index."""
        configured: dict[str, float] = {}
        for name, value in self.config.initial_joint_position.items():
            in_degrees = self.config.initial_revolute_joint_positions_are_deg and self.model[name].is_revolute
            configured[name] = math.radians(value) if in_degrees else value
        return {joint.index: configured.get(joint.name, 0.0) for joint in self.model.driven}

    def _set_alpha(self, alpha: float) -> None:
        """Makes every visual shape as opaque as asked."""
        for shape in self.pb.getVisualShapeData(self.body_id):
            self.pb.changeVisualShape(self.body_id, shape[1], rgbaColor=(*shape[7][:3], alpha))


def _load(pb: Client, config: RobotConfig) -> int:
    """Loads a robot and returns PyBullet's id of it; what is wrong with its file is told by what PyBullet needs."""
    arguments = config.loadURDF.kwargs()
    try:
        arguments["fileName"] = resolve_meshes(arguments["fileName"])
        return int(pb.loadURDF(**arguments))
    except ConfigError as error:
        messages = [f"{problem.key}: {problem.message}" for problem in error.problems]
    except (pybullet.error, OSError, UnicodeDecodeError) as error:
        messages = urdf_faults(arguments["fileName"]) or [f"PyBullet could not load it: {error}"]
    raise ConfigError([Problem(config.name, "loadURDF.fileName", message) for message in messages])
