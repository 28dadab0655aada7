"""Private parameters and `~config` of the nodes of this package."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, Literal

from pydantic import Field, model_validator

from .joint_values import JointConversion
from .marker_config import MarkerConfig
from .schema import ConfigModel, Hz, KeyedError, ListOf, Positive, Switch, Text, Unit, optional

PER_SI_UNIT = {"rad": 1.0, "deg": 180.0 / math.pi, "m": 1.0, "mm": 1000.0}
"""Number of units per rad or m."""


class StartParameters(ConfigModel):
    """Parameters of a node that is switched on and off."""

    start_on_init: Switch = Field(False, description="Whether it is on from the start.")


class RateParameters(ConfigModel):
    """Parameters of a node that repeats a message."""

    hz: Hz = Field(100.0, description="Rate of the message, in wall time.")


class RemappedJoint(ConfigModel):
    """Conversion of a joint to a driver: `sign * position * unit + offset`."""

    joint: Text = Field(description="The joint in the simulator.")
    rename: Text | None = Field(None, description="Its name at the driver; by default the same.")
    unit: Literal["rad", "deg", "m", "mm"] = Field(
        "rad",
        description="The driver's unit of positions, and of velocities per second; rad and m leave numbers unchanged.",
    )
    sign: Literal[1, -1] = Field(1, description="-1 if the driver's direction is opposite; applies to efforts, too.")
    offset: float = Field(0.0, description="The driver's position, in its unit, at position 0 of the simulator.")

    def conversion(self) -> JointConversion:
        """Returns the conversion from the simulator to the driver."""
        return JointConversion(self.joint, self.rename or self.joint, self.sign, PER_SI_UNIT[self.unit], self.offset)


class StartWithin(ConfigModel):
    """Condition for switching on: the robot is near the first command, so that it does not jump."""

    topic: Text = Field(description="Joint states of the commanded robot, in the names and units of the commands.")
    tolerance: Annotated[Positive, Unit("rad or m")] = Field(
        0.05, description="Largest difference of a joint from its first command."
    )


class RemapConfig(ConfigModel):
    """Selection and order of the forwarded joints, and their names and units there."""

    joint_names: ListOf[Text] | None = Field(
        None,
        description="Joints to forward in this order, under their names here; by default all, in the order received.",
    )
    joints: ListOf[RemappedJoint] = Field((), description="Joints whose name or unit differs at the driver.")
    inverse: Switch = Field(False, description="Whether `joints` is inverted: from the driver to the simulator.")
    start_within: StartWithin | None = optional("Condition for switching on.")

    @model_validator(mode="after")
    def _joints_differ_in_name(self) -> RemapConfig:
        _require_unique("joint", (each.joint for each in self.joints))
        _require_unique("rename", (each.conversion().name for each in self.joints))
        return self

    def conversions(self) -> tuple[JointConversion, ...]:
        """Returns the conversions of the forwarded joints."""
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
    """Selection and order of the numbers of a joint state."""

    field: Literal["position", "velocity", "effort"] = Field("position", description="Quantity to publish.")


NODE_CONFIGS: dict[str, type[ConfigModel]] = {
    "attach_marker": MarkerConfig,
    "remap_joint_state_to_floatarray": FloatArrayConfig,
    "remap_joint_state_to_joint_state": RemapConfig,
}
