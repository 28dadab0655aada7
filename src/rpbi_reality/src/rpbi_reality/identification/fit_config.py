"""Keys of the file that says which parameters of a world are identified, and from which signals."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, model_validator
from typing_extensions import Self

from custom_ros_tools.schema import (
    AlsoTakes,
    ConfigModel,
    Count,
    Expects,
    KeyedError,
    ListOf,
    NonNegative,
    Positive,
    Seconds,
    Text,
    Unit,
)
from custom_ros_tools.schema.json_schema import json_schema, schema_texts

PATH = re.compile(r"(world|measured|inputs|dynamics|[A-Za-z0-9_]+)(\.[A-Za-z0-9_/\[\]]+)+")


def _path(text: str) -> str:
    if not PATH.fullmatch(text):
        raise ValueError(f"expected OBJECT.KEY, world.KEY, measured.SIGNAL.KEY or inputs.SLOT.delay_s; got '{text}'")
    return text


def _as_list(given: Any) -> Any:
    return [given] if isinstance(given, str) else given


Bounds = Annotated[tuple[float, float], Field(strict=False)]
Paths = Annotated[
    ListOf[Annotated[Text, AfterValidator(_path)]],
    BeforeValidator(_as_list),
    AlsoTakes({"type": "string"}),
    Expects("a key or a list of keys"),
]


class ParameterConfig(ConfigModel):
    """A parameter of the world."""

    set: Paths = Field(
        description="Keys that get the parameter's value: `OBJECT.KEY`, with `[N]` for an element of a list; "
        "`world.KEY` for the main file; `dynamics.OBJECT/LINK.KEY` for the dynamics of a link; "
        "`measured.SIGNAL.offset[N]`, `measured.SIGNAL.delay_s` or `inputs.SLOT.delay_s`."
    )
    bounds: Bounds = Field(description="Smallest and largest value.")
    start: float | None = Field(None, description="First value of the search. By default, the middle of the bounds.")
    prior: Annotated[tuple[float, Positive], Field(strict=False)] | None = Field(
        None, description="Mean and standard deviation of what is known beforehand. By default, nothing is known."
    )
    scale: Literal["linear", "log"] = Field(
        "linear", description="Whether the search varies the value or its logarithm."
    )

    @model_validator(mode="after")
    def _bounds_are_ordered(self) -> Self:
        low, high = self.bounds
        if not low < high:
            raise KeyedError("bounds", f"expected [smallest, largest], got [{low:g}, {high:g}]")
        if self.scale == "log" and low <= 0.0:
            raise KeyedError("bounds", f"expected values > 0 for a logarithmic scale, got {low:g}")
        if self.start is not None and not low <= self.start <= high:
            raise KeyedError("start", f"expected a value from {low:g} to {high:g}, got {self.start:g}")
        return self

    @property
    def first(self) -> float:
        """First value of the search."""
        low, high = self.bounds
        middle = math.sqrt(low * high) if self.scale == "log" else (low + high) / 2.0
        return middle if self.start is None else self.start


class SignalConfig(ConfigModel):
    """A measured signal, and the object that it belongs to."""

    object: Text = Field(description="Object of the world: `NAME`, or `NAME/LINK` for one of its links.")
    frame: Text | None = Field(
        None, description="Object or link in whose frame the signal is measured. By default, the world."
    )
    position_sigma: Annotated[Positive, Unit("m")] = Field(0.001, description="Standard deviation of positions.")
    rotation_sigma: Annotated[Positive, Unit("rad")] = Field(0.01, description="Standard deviation of orientations.")
    joint_sigma: Annotated[Positive, Unit("rad or m")] = Field(
        0.001, description="Standard deviation of joint positions."
    )


class RunsConfig(ConfigModel):
    """Runs of the data from which parameters are identified; all other runs are held out."""

    count: Annotated[Count, Field(ge=1)] | None = Field(
        None, description="Number of runs, chosen by `seed`. By default, three quarters of the runs."
    )
    seed: Count | None = Field(0, description="Seed of this random choice; null chooses every n-th run.")
    names: ListOf[Text] = Field((), description="Names of the runs, instead of `count`.")
    experiment: Count | None = Field(None, description="Only runs of this experiment, in files with several.")


class FitConfig(ConfigModel):
    """Parameters that `./rpbi identify` identifies, and the measured signals."""

    parameters: dict[str, ParameterConfig] = Field(description="The parameters, indexed by name.")
    measured: dict[str, SignalConfig] = Field(description="Measured signals, indexed by their names in the data.")
    runs: RunsConfig = Field(RunsConfig(), description="Choice of the runs.")
    method: Literal["least_squares", "cmaes"] = Field(
        "least_squares", description="`least_squares` for smooth motion, `cmaes` where contacts make the errors rough."
    )
    objective: Literal["squares", "mean_error"] = Field(
        "squares",
        description="`squares`: robust sum of squares of errors, divided by their standard deviations. `mean_error`: "
        "mean distance and angle over time, divided by their standard deviations; only for `cmaes`.",
    )
    seed: Count = Field(0, description="Seed of the search and of the bootstrap.")
    evaluations: Annotated[Count, Field(ge=10)] = Field(
        400, description="Largest number of candidates that are simulated in all runs."
    )
    step: Positive = Field(0.2, description="First step of the search, as a fraction of the bounds.")
    start_s: Annotated[NonNegative, Unit("s")] = Field(
        0.0, description="Simulated time before a run starts, in which robots come to rest."
    )
    end_s: Seconds | None = Field(None, description="Time of a run at which the comparison ends. By default, its end.")

    @model_validator(mode="after")
    def _has_parts(self) -> Self:
        for key in ("parameters", "measured"):
            if not getattr(self, key):
                raise KeyedError(key, "expected at least one")
        if self.objective == "mean_error" and self.method != "cmaes":
            raise KeyedError("objective", "mean_error is not smooth: write `method: cmaes`")
        return self


def schema_files(root: Path) -> dict[Path, str]:
    """Returns the text of the JSON schema file, indexed by the file's path.

    Args:
        root: Root folder of the workspace.
    """
    return schema_texts(root / "src/rpbi_reality/schema", {"fit": json_schema(FitConfig, "fit")})
