"""What `remap_joint_state_to_floatarray` may be told in `~config`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from .schema import ConfigModel, ListOf, Text


class FloatArrayConfig(ConfigModel):
    """Which numbers of a joint state, in which order."""

    joint_names: ListOf[Text] | None = Field(
        None, description="Joints in the order of the numbers; without it, all as they come."
    )
    field: Literal["position", "velocity", "effort"] = Field("position", description="Which numbers of the joints.")
