"""Parameters of the ik_ros nodes, and the JSON Schemas of YAML files with these parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field, create_model, model_validator

from custom_ros_tools.node_configs import StartParameters
from custom_ros_tools.schema import (
    ConfigModel,
    Count,
    FrameId,
    Hz,
    KeyedError,
    ListOf,
    Name,
    NonNegative,
    Seconds,
    Switch,
    Text,
)
from custom_ros_tools.schema.json_schema import (
    DEFINITIONS,
    Schema,
    json_schema,
    schema_texts,
    with_definitions,
)

from .problem_stream import JointRateLimiterConfig
from .solvers import SOLVERS
from .tasks import TASKS

_OWN_TYPE = "own_type"
LISTS_OF_TASKS = ("constraints", "costs")


class RobotIKConfig(ConfigModel):
    """Options of a simulated robot's own inverse kinematics.

    Names are those of the fields of the message `CalculateInverseKinematicsProblem`.
    """

    robot_name: Name = Field(description="Name of the robot, whose YAML file must contain `start_ik_callback: true`.")
    link_name: Text = Field(description="Link that the robot moves to the target.")
    parent_frame_id: FrameId = Field(description="TF frame of the simulated world.")
    child_frame_id: FrameId = Field(description="TF frame that the link must reach.")
    lowerLimits: ListOf[float] = Field(
        (),
        description="Lower position limit of each joint that a motor can move [rad or m]. Requires `upperLimits`, "
        "`jointRanges` and `resetPoses`.",
    )
    upperLimits: ListOf[float] = Field(
        (),
        description="Upper position limit of each joint that a motor can move [rad or m]. Requires `lowerLimits`, "
        "`jointRanges` and `resetPoses`.",
    )
    jointRanges: ListOf[float] = Field(
        (), description="Range of each joint about its rest position, relative to the ranges of the other joints."
    )
    resetPoses: ListOf[float] = Field((), description="Rest position of each joint [rad or m].")
    jointDamping: ListOf[NonNegative] = Field(
        (), description="Reluctance of each joint to move, relative to the other joints."
    )
    solver: Literal[0, 1] = Field(0, description="0 for damped least squares, 1 for selectively damped least squares.")
    maxNumIterations: Count = Field(
        0, description="Largest number of iterations from one start; 0 selects the robot's default."
    )
    residualThreshold: NonNegative = Field(
        0.0, description="Distance from the target below which the search stops [m]; 0 selects the robot's default."
    )


class TargetParameters(ConfigModel):
    """Parameters of nodes that publish data from TF: publication rate, and largest age of transforms."""

    hz: Hz = Field(50.0, description="Rate of the published messages, in wall time.")
    tf_timeout_s: Seconds = Field(0.5, description="Time without new TF data after which publication pauses.")


class SetupParameters(StartParameters, TargetParameters):
    """Parameters of a setup node, with the initial values of the problems that it publishes."""

    parent_frame_id: FrameId | None = Field(
        None,
        description="TF frame in which the target is given: the solver's base. By default, problems have no target "
        "pose.",
    )
    child_frame_id: FrameId | None = Field(
        None, description="TF frame that is the target. By default, problems have no target pose."
    )
    init_bx: NonNegative = Field(
        0.0, description="Initial tolerance along the target's x axis, in both directions [m]."
    )
    init_by: NonNegative = Field(
        0.0, description="Initial tolerance along the target's y axis, in both directions [m]."
    )
    init_bz: NonNegative = Field(
        0.0, description="Initial tolerance along the target's z axis, in both directions [m]."
    )
    init_brx: NonNegative = Field(
        0.0, description="Initial tolerance about the target's x axis, in both directions [rad]."
    )
    init_bry: NonNegative = Field(
        0.0, description="Initial tolerance about the target's y axis, in both directions [rad]."
    )
    init_brz: NonNegative = Field(
        0.0, description="Initial tolerance about the target's z axis, in both directions [rad]."
    )
    goals: dict[Text, ListOf[float]] = Field(
        {}, description="Initial goals of tasks with variable goals, keyed by task name."
    )
    wait_for_start: Switch = Field(
        True, description="Whether the first problem waits for a message with the start of the search."
    )
    max_num_prev_solutions: Count = Field(1, description="Number of previous solutions that a problem contains.")
    seed: Count = Field(0, description="Seed of all random values of the solver.")

    @model_validator(mode="after")
    def _frames_go_together(self) -> SetupParameters:
        if (self.parent_frame_id is None) != (self.child_frame_id is None):
            missing = "parent_frame_id" if self.parent_frame_id is None else "child_frame_id"
            raise KeyedError(missing, "missing; parent_frame_id and child_frame_id go together")
        if self.child_frame_id is None and not self.goals:
            raise KeyedError("child_frame_id", "missing; a problem has a target frame, or goals of tasks")
        return self


class ExoticaSetupParameters(StartParameters, TargetParameters):
    """Parameters of the setup node for the solver `exotica`, as in the original package."""

    sync_tf_to_exotica_object: ListOf[Text] = Field(
        (), description="Frames of the scene that follow TF, each as `TF_PARENT TF_CHILD SCENE_PARENT SCENE_FRAME`."
    )
    max_num_prev_solutions: Count = Field(1, description="Number of previous solutions that a problem contains.")


class SolverNodeParameters(StartParameters):
    """Private parameters of a solver node itself; all other private parameters are options of the solver."""

    base_frame_id: str = Field("", description="TF frame of the solver's base. If empty, poses are not transformed.")
    continuity: JointRateLimiterConfig | None = Field(
        None,
        description="Limits of the joint velocities between successive targets. By default, the targets are the "
        "solutions.",
    )


class TfToFloatArrayConfig(TargetParameters):
    """Parameters of the node that publishes a transform as an array of numbers."""

    parent_frame_id: FrameId = Field(description="TF frame in which the pose is given.")
    child_frame_id: FrameId = Field(description="TF frame whose pose is published.")
    mode: Literal["pos", "pos+quat", "pos+eul"] = Field(
        "pos+quat",
        description="Published numbers: `pos` is x, y, z [m]; `pos+quat` adds a quaternion x, y, z, w; `pos+eul` "
        "adds roll, pitch, yaw [rad].",
    )


def schemas() -> dict[str, Schema]:
    """Generates the JSON Schema of each solver's options, indexed by solver name.

    Leaves out solvers whose libraries are not installed.
    """
    found = {}
    for name, config in SOLVERS.configs().items():
        both = create_model(config.__name__, __base__=(config, SolverNodeParameters), __doc__=config.__doc__)
        found[name] = json_schema(both, name)
    if "tasks" in found:
        definitions = {**found["tasks"].get(DEFINITIONS, {}), **_tasks()}
        any_task = {"anyOf": [{"$ref": f"#/{DEFINITIONS}/{kind}"} for kind in (*TASKS, _OWN_TYPE)]}
        for key in LISTS_OF_TASKS:
            found["tasks"]["properties"][key]["items"] = any_task
        found["tasks"] = with_definitions(found["tasks"], definitions)
    return found


def _tasks() -> dict[str, Schema]:
    """Generates the schema definitions of all types of tasks, and of the models that task options contain."""
    own_type = {"type": "string", "pattern": r"^[\w.]+:\w+$"}
    definitions: dict[str, Schema] = {
        _OWN_TYPE: {"type": "object", "properties": {"type": own_type}, "required": ["type"]}
    }
    for kind, schema in TASKS.schemas().items():
        definitions |= schema.pop(DEFINITIONS, {})
        schema["properties"] = {**schema["properties"], "type": {"enum": [kind]}}
        definitions[kind] = {key: value for key, value in schema.items() if key != "$schema"}
    return definitions


def schema_files(root: Path) -> dict[Path, str]:
    """Generates the JSON Schema files of this package, and returns the text by file path.

    Args:
        root: Folder of the workspace.
    """
    return schema_texts(root / "src/ik_ros/schema", schemas())
