"""All axes together, no faster in a diagonal than along an axis."""

import math
from collections.abc import Sequence

from pydantic import Field

from custom_ros_tools.schema import NonNegative

from .mapping import AxesConfig, Mapping


class IsometricConfig(AxesConfig):
    """Which axes become the signal, and how long it is at most."""

    scale: NonNegative = Field(1.0, description="Length of the signal when the device is moved as far as it goes.")


class IsometricMapping(Mapping):
    """A vector of the axes, at most `scale` long: `scale * min(n, 1) / n * a`, where n is the length of the axes a."""

    Config = IsometricConfig

    def __init__(self, config: IsometricConfig) -> None:
        self._config, self.size = config, len(config.axes_idx)

    def map(self, axes: Sequence[float]) -> tuple[float, ...]:
        """Returns the signal, see `Mapping`."""
        picked = self._config.pick(axes)
        factor = self._config.scale / max(math.hypot(*picked), 1.0)  # min(n, 1) / n, also for n = 0
        return tuple(factor * axis for axis in picked)
