"""What `remap_joint_state_to_floatarray` may be told in `~config`."""

from __future__ import annotations

from typing import Literal

from .schema import ConfigModel, ListOf, Text


class FloatArrayConfig(ConfigModel):
    """Which numbers of a joint state, in which order."""

    joint_names: ListOf[Text] | None = None
    field: Literal["position", "velocity", "effort"] = "position"
