"""Private parameters that several nodes have."""

from __future__ import annotations

from pydantic import Field

from .schema import ConfigModel, Hz, Switch


class StartParameters(ConfigModel):
    """Of a node that is switched on and off."""

    start_on_init: Switch = Field(False, description="Whether it is on from the start.")


class RateParameters(ConfigModel):
    """Of a node that repeats what it says."""

    hz: Hz = Field(100.0, description="How often it is said, in wall time.")
