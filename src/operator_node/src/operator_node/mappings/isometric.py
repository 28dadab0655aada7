"""All axes as one vector, so that diagonal motion is no faster than motion along an axis."""

import math
from collections.abc import Sequence

from pydantic import Field

from custom_ros_tools.schema import NonNegative

from .mapping import AxesConfig, Mapping


class IsometricConfig(AxesConfig):
    """The axes that make up the signal, and the largest length of the signal."""

    scale: NonNegative = Field(1.0, description="Length of the signal at full deflection.")


class IsometricMapping(Mapping):
    """Scales the vector a of the axes to at most `scale`: `scale * min(n, 1) / n * a`, where n is the length of a."""

    Config = IsometricConfig

    def __init__(self, config: IsometricConfig) -> None:
        self._config, self.size = config, len(config.axes_idx)

    def map(self, axes: Sequence[float]) -> tuple[float, ...]:
        """Returns the signal, see `Mapping`."""
        picked = self._config.pick(axes)
        factor = self._config.scale / max(math.hypot(*picked), 1.0)  # min(n, 1) / n, also for n = 0
        return tuple(factor * axis for axis in picked)
