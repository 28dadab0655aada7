"""The configuration of a guard."""

from typing import Annotated, Any, Literal

from pydantic import Field, field_validator

from custom_ros_tools.schema import ConfigModel, ListOf, NonNegative, Seconds, Switch, Text, optional
from custom_ros_tools.schema.type_names import shown

from .commands.shaping import ShapingConfig
from .limits import LimitsConfig


class GuardConfig(ConfigModel):
    """Parameters of a guard, which checks each joint target before the robot receives the target."""

    policy: Literal["reject", "limit"] = Field(
        "reject",
        description="Treatment of unsafe targets: `reject` sends no command and halts; `limit` sends a safe command "
        "instead, and continues.",
    )
    on_halt: Literal["nothing", "brake"] = Field(
        "nothing",
        description="Commands after a halt during a motion: `nothing` sends no commands; `brake` sends one command "
        "each `period_s`, along the braking motion that was checked together with the last command.",
    )
    period_s: Annotated[Seconds, Field(ge=1e-5, le=10.0)] = Field(
        0.009,
        description="Least time between two commands, which checks also assume as the duration of each command. "
        "Choose a few percent less than the time between two targets, so that the guard can catch up after late "
        "targets.",
    )
    joint_names: ListOf[Text] = Field((), description="Joints that are guarded. By default, all joints of the robot.")
    limits: LimitsConfig = Field(LimitsConfig(), description="Limits of the joints.")
    shape: ShapingConfig | None = optional(
        "Smoothing, before the checks, of targets that joints cannot follow. By default, targets are not smoothed."
    )
    start_from: Literal["measured", "target"] = Field(
        "measured",
        description="State of the robot before the first command: the measured positions, or the first target.",
    )
    start_tolerance: NonNegative = Field(
        0.05, description="Largest distance of the first target from the robot's measured position [rad or m]."
    )
    checks: dict[str, dict[str, Any]] = Field({}, description="Options of the checks, keyed by check name.")

    @field_validator("joint_names", mode="before")
    @classmethod
    def _check_joint_names(cls, value: Any) -> Any:
        if isinstance(value, list) and not value:
            raise ValueError("expected a joint, got []; leave the key out to guard all joints")
        if isinstance(value, list) and (twice := [name for i, name in enumerate(value) if name in value[:i]]):
            raise ValueError(f"expected each joint once, got {shown(twice[0])} twice")
        return value


class NodeConfig(ConfigModel):
    """Options of the guard's ROS node: message types, timeout of targets, and source of obstacles."""

    publish_as_joint_state: Switch = Field(
        True,
        description="Whether commands are published as joint states, otherwise as arrays of positions in the order "
        "of the joints.",
    )
    status_as_diagnostic: Switch = Field(
        False,
        description="Whether robot_safety/status is a diagnostic_msgs/DiagnosticStatus, as in the README of the "
        "authors' release; otherwise a safe_robot/Status.",
    )
    targets_are_states: Switch = Field(
        False,
        description="Whether targets are measured joint states, of which only the positions of guarded joints are "
        "used.",
    )
    silence_s: Seconds = Field(
        0.02,
        description="Largest age of the newest target at which waiting targets are sent. If the newest target is "
        "older, waiting targets are held until a new target arrives.",
    )
    base_frame: Text | None = Field(
        None,
        description="TF frame of the robot's root link, in which markers are published. With this key, the check "
        "`environment` also uses the bodies of rpbi/markers. By default, the name of the root link in the URDF is "
        "used for markers.",
    )
    left_out: ListOf[Text] = Field(
        (), description="Bodies of rpbi/markers that are not obstacles, in particular the robot itself."
    )
