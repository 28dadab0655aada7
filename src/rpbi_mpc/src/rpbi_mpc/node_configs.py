"""Parameters of the nodes, and the schemas of the YAML files that contain these parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field, model_validator

from custom_ros_tools.schema import (
    ConfigModel,
    Hz,
    KeyedError,
    PositiveMetres,
    Seconds,
    Switch,
    Text,
    TopicName,
    optional,
)
from custom_ros_tools.schema.json_schema import Schema, json_schema, resolved, schema_texts
from rpbi_mpc.pushing.hand import PlanarHandConfig

from .loop import LoopConfig
from .pushing.config import PushingConfig
from .pushing.sampling_planner import PushSamplingConfig
from .sampling import SAMPLERS, InputConfig, SamplingConfig

SAME_S = 1e-9
"""Difference below which two times count as equal [s]."""


class PlantConfig(ConfigModel):
    """Names and topics of slider and robot, and timing and limits of the plant."""

    robot: Text = Field("nextage", description="Name of the robot that receives the targets, NAME in rpbi/NAME.")
    joint_states: TopicName = Field(
        "rpbi/nextage/joint_states", description="Topic of the robot's joint states; on hardware, the measured ones."
    )
    slider: Text = Field("box", description="Name of the slider in the simulated world, for predictions.")
    vicon: TopicName = Field(
        "vicon/box/box",
        description="Topic of the pose of the slider's middle. In a stepped world, the TF frame of this name is used "
        "instead.",
    )
    timeout_s: Seconds = Field(0.2, description="Time without a pose after which the slider counts as lost.")
    ready: TopicName | None = optional(
        "Topic whose first message shows that the robot accepts commands; only with `timed`. By default, the node "
        "does not wait for such a message."
    )
    max_lead: PositiveMetres = Field(
        0.06,
        description="Distance of the hand from its target above which the plant stops, for instance because a guard "
        "has halted the robot.",
    )
    target_hz: Hz = Field(
        100.0,
        description="Rate of the robot's targets. The delay and the period of the loop must be whole multiples of "
        "the time between two targets.",
    )
    timed: Switch = Field(
        False,
        description="Whether the plant runs in real time, as hardware does; otherwise the simulated world waits for "
        "each plan.",
    )


class PushingNodeConfig(ConfigModel):
    """Parameters of the node that pushes a slider along a path with a robot's hand."""

    loop: LoopConfig = Field(LoopConfig(), description="Timing of the loop.")
    controller: Literal["program", "sampling"] = Field(
        "program",
        description="Planner: `program` solves a nonlinear program, `sampling` simulates candidates in forks of a "
        "stepped world.",
    )
    pushing: PushingConfig = Field(PushingConfig(), description="Slider, path, cost, solver and limits of the push.")
    sampling: PushSamplingConfig = Field(PushSamplingConfig(), description="Options of the controller `sampling`.")
    hand: PlanarHandConfig = Field(description="Hand that pushes the slider.")
    plant: PlantConfig = Field(PlantConfig(), description="Topics, names and timing of the plant.")

    @model_validator(mode="after")
    def _fits_together(self) -> PushingNodeConfig:
        if abs(self.pushing.cycle_s - self.loop.period_s) > SAME_S:
            got = f"got {self.pushing.cycle_s:g}"
            raise KeyedError("pushing.cycle_s", f"expected the {self.loop.period_s:g} s of a cycle of loop.hz, {got}")
        if self.controller == "sampling" and self.plant.timed:
            expected = "expected program with plant.timed: time would pass while sampling simulates"
            raise KeyedError("controller", expected)
        for name, part_s in (("delay_s", self.loop.delay_s), ("hz", self.loop.period_s)):
            targets = part_s * self.plant.target_hz
            if abs(targets - round(targets)) > 1e-6:
                got = f"got {targets:g} in {part_s:g} s"
                raise KeyedError(f"loop.{name}", f"expected a whole number of targets at plant.target_hz, {got}")
        return self


class SamplingNodeConfig(ConfigModel):
    """Parameters of the node that plans the commands of a robot by simulating candidate plans."""

    loop: LoopConfig = Field(LoopConfig(hz=10.0), description="Timing of the loop.")
    sampling: SamplingConfig = Field(SamplingConfig(), description="Horizon, knots and sampler of the candidates.")
    command: InputConfig = Field(description="Input of the world that is commanded, with its limits.")
    cost: Text = Field(
        description="Cost of a state, which is summed over all ticks: `module:name` of a function of the World, or "
        "of a class. The package must be in `trusted_packages` of the world."
    )


CONFIGS: dict[str, type[ConfigModel]] = {"pushing_mpc": PushingNodeConfig, "sampling_mpc": SamplingNodeConfig}
"""Class of the parameters of each node, indexed by node name."""


def schema_files(root: Path) -> dict[Path, str]:
    """Returns the text of each JSON schema file, indexed by the file's path.

    Args:
        root: Root folder of the workspace.
    """
    found = {name: json_schema(config, name) for name, config in CONFIGS.items()}
    for schema in found.values():
        resolved(schema["properties"]["sampling"], schema)["properties"]["sampler"] = _any_sampler()
    return schema_texts(root / "src/rpbi_mpc/schema", found)


def _any_sampler() -> Schema:
    """Returns the JSON schema for the options of any sampler: one of `SAMPLERS`, or a user-defined class."""
    own_type = {"type": "object", "properties": {"type": {"pattern": r"^[\w.]+:\w+$"}}, "required": ["type"]}
    known = [
        {**schema, "properties": {"type": {"enum": [name]}, **schema["properties"]}, "required": ["type"]}
        for name, schema in SAMPLERS.schemas().items()
    ]
    return {
        "description": "Sampler, which draws candidates and computes the plan from their costs.",
        "anyOf": [*known, own_type],
    }
