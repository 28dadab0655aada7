"""Private parameters that several nodes have."""

from __future__ import annotations

from .schema import ConfigModel, Hz, Switch


class StartParameters(ConfigModel):
    """Of a node that is switched on and off."""

    start_on_init: Switch = False


class RateParameters(ConfigModel):
    """Of a node that repeats what it says."""

    hz: Hz = 100.0
