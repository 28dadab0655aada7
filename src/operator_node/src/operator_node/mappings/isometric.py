"""Mapping that treats all axes as one vector, so that diagonal motion is not faster than motion along an axis."""

import math
from collections.abc import Sequence

from .mapping import Mapping
from .scale import ScaleConfig


class IsometricMapping(Mapping):
    """Shortens the vector of the selected axes to length 1 if it is longer, and multiplies the result by `scale`.

    `scale` may be a list with one factor for each axis. For example, `[-0.2, 0.2, 0.2]` reverses the first axis.
    """

    Config = ScaleConfig

    def __init__(self, config: ScaleConfig) -> None:
        self._config, self.size = config, len(config.axes_idx)
        self._scale = config.factors

    def map(self, axes: Sequence[float]) -> tuple[float, ...]:
        """Returns the limited and scaled axes, see `Mapping.map`."""
        picked = self._config.pick(axes)
        length = max(math.hypot(*picked), 1.0)  # min(n, 1) / n, also for n = 0
        return tuple(scale * axis / length for scale, axis in zip(self._scale, picked))
