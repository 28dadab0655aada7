"""Parameters of the planner's node, and the schema of the YAML files that contain them."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field

from custom_ros_tools.schema import (
    ConfigModel,
    Fraction,
    FrameId,
    Hz,
    ListOf,
    NonNegative,
    NonNegativeMetres,
    Positive,
    Seconds,
    Switch,
    Text,
    TopicName,
    optional,
)
from custom_ros_tools.schema.json_schema import json_schema, schema_texts


class MotionPlannerConfig(ConfigModel):
    """Robot, scene, limits and topics of the node that plans and executes motions."""

    robot: Text | None = optional(
        "Name of the robot in the world. By default, the only robot that follows trajectories."
    )
    group: ListOf[Text] = Field(
        (), description="Joints that may move. By default, the joints of the robot's trajectory controller."
    )
    link: Text | None = optional("Link that `planner/plan_to_frame` brings to `goal_frame`. By default, the last link.")
    goal_frame: FrameId = Field("rpbi/goal", description="TF frame to which `planner/plan_to_frame` plans.")
    postures: dict[str, dict[str, float]] = Field(
        {}, description="Named goals: for each name, positions of joints [rad or m], indexed by joint."
    )
    world: Text | None = optional(
        "Main YAML file of the world. By default, the world of the running simulator, on `rpbi/world_description`."
    )
    tracked: dict[str, FrameId] = Field(
        {}, description="TF frame of each body that a tracking system tracks, indexed by the body's name."
    )
    padding_m: NonNegativeMetres = Field(
        0.01, description="Least distance of a planned motion from bodies and other robots."
    )
    left_out: ListOf[Text] = Field((), description="Names of bodies that are not obstacles.")
    timeout_s: Seconds = Field(
        1.0, description="Largest age of poses and joint states. While one is older, the node plans nothing."
    )
    planner: Text = Field("rrt_connect", description="Planner, a name from docs/planning.md.")
    time_limit_s: Seconds = Field(5.0, description="Longest time to search for a path.")
    shorten_s: NonNegative = Field(0.3, description="Time for shortening a path [s].")
    certify: Switch = Field(
        True, description="Whether each plan is passed through the guard's checks before it is offered."
    )
    speed: Fraction = Field(0.5, description="Share of the velocity limits in the URDF that motions use.")
    acceleration: Positive = Field(5.0, description="Largest acceleration of a joint [rad/s^2 or m/s^2].")
    jerk: Positive = Field(50.0, description="Largest jerk of a joint [rad/s^3 or m/s^3].")
    action: TopicName | None = optional(
        "Action that executes trajectories, of a controller or a driver. By default, "
        "`rpbi/NAME/joint_trajectory_controller/follow_joint_trajectory`."
    )
    joint_states: TopicName | None = optional(
        "Topic of the robot's measured joint states. By default, `rpbi/NAME/joint_states`."
    )
    check_hz: Hz = Field(10.0, description="Rate of the checks whether an obstacle has come into the way.")
    wait_s: NonNegative = Field(
        10.0, description="Longest time to wait for an obstacle to leave if there is no other path [s]."
    )


def schema_files(root: Path) -> dict[Path, str]:
    """Returns the text of the JSON schema file, indexed by the file's path.

    Args:
        root: Root folder of the workspace.
    """
    schema = json_schema(MotionPlannerConfig, "motion_planner")
    return schema_texts(root / "src/rpbi_planning/schema", {"motion_planner": schema})
