"""Configuration of `stand_in_node.py`, including the limits of robots' joints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field, model_validator

from custom_ros_tools.config import load_config, replace_package
from custom_ros_tools.errors import ConfigError, Problem, UnknownNameError
from custom_ros_tools.node_configs import RemapConfig
from custom_ros_tools.schema import (
    ConfigModel,
    Count,
    Fraction,
    Hz,
    KeyedError,
    Name,
    NonNegative,
    Positive,
    Seconds,
    Text,
    Unit,
    optional,
)

ROBOTS = ("kuka_iiwa", "kuka_lwr", "panda")
"""Names of the robots whose limits are in `{rpbi_utils}/configs/stand_in`."""

Angle = Annotated[float, Unit("rad or m")]
PositiveAngle = Annotated[Positive, Unit("rad or m")]
NoNegativeTime = Annotated[NonNegative, Unit("s")]


class DriverJointLimits(ConfigModel):
    """Limits that a robot's controller checks for one joint."""

    lower: Angle = Field(description="Lower position limit.")
    upper: Angle = Field(description="Upper position limit.")
    velocity: Annotated[Positive, Unit("rad/s or m/s")] = Field(description="Largest commanded speed.")
    acceleration: Annotated[Positive, Unit("rad/s^2 or m/s^2")] = Field(
        description="Largest commanded acceleration, and deceleration of a reflex stop."
    )
    jerk: Annotated[Positive, Unit("rad/s^3 or m/s^3")] = Field(description="Largest commanded jerk.")
    torque: Annotated[Positive, Unit("N m or N")] = Field(description="Motor effort that triggers a reflex.")
    step: PositiveAngle | None = optional(
        "Largest distance between two commands. By default, the distance that the joint covers in one cycle at three "
        "times `velocity`."
    )
    following_error: PositiveAngle = Field(
        0.2, description="Largest distance of the measured position from the commanded position."
    )

    @model_validator(mode="after")
    def _lower_is_below_upper(self) -> DriverJointLimits:
        if self.lower >= self.upper:
            raise KeyedError("upper", f"must be above lower, {self.lower:g}, got {self.upper:g}")
        return self


class NoiseConfig(ConfigModel):
    """Noise and delay that are added to measured joint states."""

    position: Annotated[NonNegative, Unit("rad or m")] = Field(
        0.0, description="Standard deviation of the noise of positions."
    )
    velocity: Annotated[NonNegative, Unit("rad/s or m/s")] = Field(
        0.0, description="Standard deviation of the noise of velocities."
    )
    effort: Annotated[NonNegative, Unit("N m or N")] = Field(
        0.0, description="Standard deviation of the noise of efforts."
    )
    delay_s: NoNegativeTime = Field(0.0, description="Age of joint states when they are published.")
    seed: Count = Field(0, description="Seed of the noise.")


class FakeDriverConfig(ConfigModel):
    """Emulated robot driver: the robot, its joint limits, timing, delays and noise, and names and units of joints."""

    robot: Name = Field(description="Name of the simulated robot, NAME in `rpbi/NAME`, in the node's namespace.")
    limits: Text = Field(description=f"Joint limits: those of {', '.join(ROBOTS)}, or a YAML file with limits.")
    joint_limits: dict[Text, dict[Text, Any]] = Field(
        {}, description="Limits that replace those of `limits`, keyed by joint name and by the name of the limit."
    )
    driver: RemapConfig = Field(
        RemapConfig(),
        description="Names, units and order of joints at the emulated driver, as in the nodes that remap joint "
        "states for a driver.",
    )
    command_hz: Hz = Field(100.0, description="Rate of the emulated controller, which expects one command per cycle.")
    rate_tolerance: Annotated[Fraction, Field(gt=0)] = Field(
        0.3, description="Largest deviation of the commands' rate over one second, as a fraction of `command_hz`."
    )
    timeout_s: Seconds = Field(0.1, description="Time without a command after which a moving robot stops.")
    start_tolerance: PositiveAngle = Field(
        0.02, description="Largest distance of the first command from the position that the robot holds."
    )
    torque_time_s: NoNegativeTime = Field(
        0.05, description="Time at a motor's effort limit after which a reflex is triggered."
    )
    command_delay_s: NoNegativeTime = Field(0.0, description="Delay of commands until they reach the motors.")
    noise: NoiseConfig = Field(NoiseConfig(), description="Noise and delay of the published joint states.")

    def load_limits(self) -> dict[str, DriverJointLimits]:
        """Returns the joint limits, keyed by joint name in the simulator. The keys have the driver's joint order.

        Raises:
            ConfigError: If the limits cannot be read or are invalid.
        """
        if "." not in self.limits and self.limits not in ROBOTS:
            raise ConfigError([Problem("~config", "limits", str(UnknownNameError("robot", self.limits, ROBOTS)))])
        file = f"{{rpbi_utils}}/configs/stand_in/{self.limits}.yaml" if self.limits in ROBOTS else self.limits
        data = load_config(file)
        joints = data.get("joints")
        for joint, changes in self.joint_limits.items():
            if not isinstance(joints, dict) or joint not in joints:
                known = joints if isinstance(joints, dict) else ()
                what = str(UnknownNameError("joint", joint, known))
                raise ConfigError([Problem("~config", f"joint_limits.{joint}", what)])
            if isinstance(joints[joint], Mapping):
                joints[joint] = {**joints[joint], **changes}
        with_changes = " with ~config.joint_limits" if self.joint_limits else ""
        limits = RobotLimits.parse(data, f"{replace_package(file)}{with_changes}").joints
        for index, each in enumerate(self.driver.joints):
            if each.joint not in limits:
                what = str(UnknownNameError("joint", each.joint, limits))
                raise ConfigError([Problem("~config", f"driver.joints[{index}].joint", what)])
        order = limits if self.driver.joint_names is None else self.driver.joint_names
        if sorted(order) != sorted(limits):
            what = f"expected all of {', '.join(limits)}, got {', '.join(order)}"
            raise ConfigError([Problem("~config", "driver.joint_names", what)])
        return {joint: limits[joint] for joint in order}


class RobotLimits(ConfigModel):
    """Content of a YAML file with the limits of a robot's joints."""

    joints: dict[Text, DriverJointLimits] = Field(
        description="Limits of the joints, keyed by joint name in the simulator."
    )

    @model_validator(mode="after")
    def _has_joints(self) -> RobotLimits:
        if not self.joints:
            raise KeyedError("joints", "expected at least one joint")
        return self
