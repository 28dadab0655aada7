"""What YAML may say of a body's contacts."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Hz, HzOrOff, Positive, Unit


class ContactsConfig(ConfigModel):
    """How a body's contacts are told."""

    hz: Hz = Field(50.0, description="Rate of `rpbi/NAME/contacts`.")
    arrows_hz: HzOrOff = Field(20.0, description="Rate of the arrows for RViz; 0 is off.")
    arrow_metres_per_newton: Annotated[Positive, Unit("m/N")] = Field(
        0.01, description="Length of an arrow by the force that it stands for."
    )
