"""Private parameters of `ik_setup_node.py`."""

from __future__ import annotations

from pydantic import Field, model_validator

from custom_ros_tools.node_parameters import StartParameters
from custom_ros_tools.schema import ConfigModel, Count, FrameId, Hz, KeyedError, ListOf, NonNegative, Seconds, Text


class TargetParameters(ConfigModel):
    """How often a target is told, and for how long it counts."""

    hz: Hz = Field(50.0, description="How often it is told, in wall time.")
    tf_timeout_s: Seconds = Field(0.5, description="How long it lasts when its TF stops; then nothing is told.")


class SetupParameters(StartParameters, TargetParameters):
    """What problems are made of."""

    parent_frame_id: FrameId | None = Field(None, description="TF frame that the target is in: the solver's base.")
    child_frame_id: FrameId | None = Field(None, description="TF frame that is the target.")
    init_bx: NonNegative = Field(0.0, description="How far off the target along its x axis will do, both ways [m].")
    init_by: NonNegative = Field(0.0, description="The same along y [m].")
    init_bz: NonNegative = Field(0.0, description="The same along z [m].")
    init_brx: NonNegative = Field(0.0, description="How far turned about its x axis will do, both ways [rad].")
    init_bry: NonNegative = Field(0.0, description="The same about y [rad].")
    init_brz: NonNegative = Field(0.0, description="The same about z [rad].")
    goals: dict[Text, ListOf[float]] = Field({}, description="First goals of tasks that change, by task.")
    max_num_prev_solutions: Count = Field(1, description="How many previous solutions a problem tells.")
    seed: Count = Field(0, description="Of whatever is random in the solver.")

    @model_validator(mode="after")
    def _frames_go_together(self) -> SetupParameters:
        if (self.parent_frame_id is None) != (self.child_frame_id is None):
            missing = "parent_frame_id" if self.parent_frame_id is None else "child_frame_id"
            raise KeyedError(missing, "missing; parent_frame_id and child_frame_id go together")
        if self.child_frame_id is None and not self.goals:
            raise KeyedError("child_frame_id", "missing; a problem has a target frame, or goals of tasks")
        return self
