"""Interface of all mappings."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Count, ListOf


class AxesConfig(ConfigModel):
    """Selection of axes of a device."""

    axes_idx: ListOf[Count] = Field(
        min_length=1, description="Indices of axes, from 0 on, in the order of the signal; one may occur twice."
    )

    dead_zone: float = Field(
        0.0,
        ge=0.0,
        lt=1.0,
        description="Share of the range of an axis that counts as 0; from there the axis rises to 1 at its end.",
    )

    def pick(self, axes: Sequence[float]) -> list[float]:
        """Returns the selected axes after removal of their dead zone.

        Raises:
            ValueError: If there are too few.
        """
        largest = max(self.axes_idx)
        if largest >= len(axes):
            raise ValueError(f"expected at least {largest + 1} axes (axes_idx has {largest}), got {len(axes)}")
        return [self._beyond(axes[index]) for index in self.axes_idx]

    def _beyond(self, axis: float) -> float:
        zone = self.dead_zone
        return math.copysign(max(abs(axis) - zone, 0.0) / (1.0 - zone), axis) if zone else axis


class Mapping(ABC):
    """Maps the axes of a device to the operator's signal.

    Its options are its `Config`, the argument of its constructor. It has no state: equal axes result in equal signals.

    Attributes:
        Config: Model of its options.
        size: Number of values of its signal.
    """

    Config: ClassVar[type[ConfigModel]]
    size: int

    @abstractmethod
    def map(self, axes: Sequence[float]) -> tuple[float, ...]:
        """Returns the signal, `size` numbers, for the axes of a device, which are finite.

        Raises:
            ValueError: If there are too few axes.
        """
