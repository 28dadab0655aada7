"""Interface of the mappings from the axes of a device to the operator's signal."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Count, ListOf


class AxesConfig(ConfigModel):
    """Selection of a device's axes, and their dead zone."""

    axes_idx: ListOf[Count] = Field(
        min_length=1,
        description="Indices of joystick axes, counted from 0, in the order of the signal. An index may occur twice.",
    )

    dead_zone: float = Field(
        0.0,
        ge=0.0,
        lt=1.0,
        description="Fraction of an axis's range that counts as 0. Beyond it, the value rises from 0 to 1 at the end "
        "of the axis.",
    )

    def pick(self, axes: Sequence[float]) -> list[float]:
        """Returns the values of the selected axes, with the dead zone applied.

        Raises:
            ValueError: If the device has too few axes.
        """
        largest = max(self.axes_idx)
        if largest >= len(axes):
            raise ValueError(f"expected at least {largest + 1} axes (axes_idx has {largest}), got {len(axes)}")
        return [self._beyond(axes[index]) for index in self.axes_idx]

    def _beyond(self, axis: float) -> float:
        zone = self.dead_zone
        return math.copysign(max(abs(axis) - zone, 0.0) / (1.0 - zone), axis) if zone else axis


class Mapping(ABC):
    """Base class of the mappings from the axes of a device to the operator's signal.

    The constructor of a mapping has one argument, the options of type `Config`. A mapping has no state: equal axes
    result in equal signals.

    Attributes:
        Config: Model of the mapping's options.
        size: Number of values in the signal.
    """

    Config: ClassVar[type[ConfigModel]]
    size: int

    @abstractmethod
    def map(self, axes: Sequence[float]) -> tuple[float, ...]:
        """Maps the axes of a device, which are finite, to a signal of `size` numbers.

        Raises:
            ValueError: If the device has too few axes.
        """
