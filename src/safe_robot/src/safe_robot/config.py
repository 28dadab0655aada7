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
        description="Policy for unsafe targets: reject sends nothing and halts; limit sends a safe command instead,"
        " and continues.",
    )
    on_halt: Literal["nothing", "brake"] = Field(
        "nothing",
        description="Commands after a halt during a motion: none; or the braking that was found safe with the last"
        " command, one command each period_s.",
    )
    period_s: Annotated[Seconds, Field(ge=1e-5, le=10.0)] = Field(
        0.009,
        description="Shortest time between two commands, and the time that each of them counts as. Choose a few percent"
        " less than the time between two targets, so that the guard can catch up after late ones.",
    )
    joint_names: ListOf[Text] = Field((), description="The joints that are guarded; by default all of the robot.")
    limits: LimitsConfig = Field(LimitsConfig(), description="Limits of the joints.")
    shape: ShapingConfig | None = optional(
        "Smoothing of targets that joints cannot follow, before the checks; without it there is none."
    )
    start_from: Literal["measured", "target"] = Field(
        "measured", description="State of the robot before the first command: as measured, or the first target."
    )
    start_tolerance: NonNegative = Field(
        0.05, description="Largest distance of the first target from the robot's position [rad or m]."
    )
    checks: dict[str, dict[str, Any]] = Field({}, description="Options of checks by name.")

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
        True, description="Whether commands are joint states; else bare numbers in the order of the joints."
    )
    status_as_diagnostic: Switch = Field(
        False,
        description="Whether robot_safety/status is a diagnostic_msgs/DiagnosticStatus, as the README of the authors'"
        " release has it; else a safe_robot/Status.",
    )
    targets_are_states: Switch = Field(
        False,
        description="Whether targets are joint states that are measured; only the positions of guarded joints count.",
    )
    silence_s: Seconds = Field(
        0.02,
        description="Largest age of the newest target at which waiting targets are sent; beyond it, they wait for a"
        " newer one. A source that has died is followed for no longer than this.",
    )
    base_frame: Text | None = Field(
        None,
        description="TF frame of the robot's root, which markers are shown in; with it the check `environment` uses"
        " the bodies of rpbi/markers.",
    )
    left_out: ListOf[Text] = Field(
        (), description="Bodies of rpbi/markers that are no obstacles, in particular the robot itself."
    )
