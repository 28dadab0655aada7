"""What the nodes of this package take as private parameters and in `~config`."""

from typing import Literal

from pydantic import Field

from .marker_config import MarkerConfig
from .schema import ConfigModel, Hz, ListOf, Switch, Text


class StartParameters(ConfigModel):
    """Of a node that is switched on and off."""

    start_on_init: Switch = Field(False, description="Whether it is on from the start.")


class RateParameters(ConfigModel):
    """Of a node that repeats what it says."""

    hz: Hz = Field(100.0, description="How often it is said, in wall time.")


class FloatArrayConfig(ConfigModel):
    """Which numbers of a joint state, in which order."""

    joint_names: ListOf[Text] | None = Field(
        None, description="Joints in the order of the numbers; without it, all as they come."
    )
    field: Literal["position", "velocity", "effort"] = Field("position", description="Which numbers of the joints.")


NODE_CONFIGS: dict[str, type[ConfigModel]] = {
    "attach_marker": MarkerConfig,
    "remap_joint_state_to_floatarray": FloatArrayConfig,
}
