"""What the nodes of this package take as private parameters and in `~config`."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Literal

from pydantic import Field, model_validator

from .joint_values import JointConversion
from .marker_config import MarkerConfig
from .schema import ConfigModel, Hz, KeyedError, ListOf, Switch, Text

PER_SI_UNIT = {"rad": 1.0, "deg": 180.0 / math.pi, "m": 1.0, "mm": 1000.0}
"""How many of a unit one rad or m is."""


class StartParameters(ConfigModel):
    """Of a node that is switched on and off."""

    start_on_init: Switch = Field(False, description="Whether it is on from the start.")


class RateParameters(ConfigModel):
    """Of a node that repeats what it says."""

    hz: Hz = Field(100.0, description="How often it is said, in wall time.")


class RemappedJoint(ConfigModel):
    """How a driver counts a joint: `sign * position * unit + offset`."""

    joint: Text = Field(description="The joint in the simulator.")
    rename: Text | None = Field(None, description="Its name at the driver; without it, the same.")
    unit: Literal["rad", "deg", "m", "mm"] = Field(
        "rad", description="The driver's unit of positions, and of velocities a second; rad and m leave numbers alone."
    )
    sign: Literal[1, -1] = Field(1, description="-1 where the driver counts the other way; of efforts too.")
    offset: float = Field(0.0, description="The driver's position, in its unit, where the simulator's is 0.")

    def conversion(self) -> JointConversion:
        """Returns what leads from the simulator to the driver."""
        return JointConversion(self.joint, self.rename or self.joint, self.sign, PER_SI_UNIT[self.unit], self.offset)


class RemapConfig(ConfigModel):
    """Which joints of a joint state are handed on, and how they are named and counted there."""

    joint_names: ListOf[Text] | None = Field(
        None, description="Joints to hand on in this order, named as they come; without it, all as they come."
    )
    joints: ListOf[RemappedJoint] = Field((), description="Joints that the driver names or counts otherwise.")
    inverse: Switch = Field(False, description="Whether `joints` is undone: from the driver to the simulator.")

    @model_validator(mode="after")
    def _joints_differ_in_name(self) -> RemapConfig:
        _require_unique("joint", (each.joint for each in self.joints))
        _require_unique("rename", (each.conversion().name for each in self.joints))
        return self

    def conversions(self) -> tuple[JointConversion, ...]:
        """Returns what is done to the joints that are handed on."""
        there = (each.conversion() for each in self.joints)
        conversions = (each.inverse() if self.inverse else each for each in there)
        wanted = self.joint_names
        return tuple(each for each in conversions if wanted is None or each.joint in wanted)


def _require_unique(key: str, names: Iterable[str]) -> None:
    seen: set[str] = set()
    for index, name in enumerate(names):
        if name in seen:
            raise KeyedError(f"joints[{index}].{key}", f"'{name}' is the name of another joint of this list")
        seen.add(name)


class FloatArrayConfig(RemapConfig):
    """Which numbers of a joint state, in which order."""

    field: Literal["position", "velocity", "effort"] = Field("position", description="Which numbers of the joints.")


NODE_CONFIGS: dict[str, type[ConfigModel]] = {
    "attach_marker": MarkerConfig,
    "remap_joint_state_to_floatarray": FloatArrayConfig,
    "remap_joint_state_to_joint_state": RemapConfig,
}
