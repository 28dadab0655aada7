"""What every mapping is."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Count, ListOf


class AxesConfig(ConfigModel):
    """Which axes of a device count."""

    axes_idx: ListOf[Count] = Field(
        min_length=1, description="Numbers of axes, from 0 on, in the order of the signal; one may come twice."
    )

    def pick(self, axes: Sequence[float]) -> list[float]:
        """Returns the axes that count.

        Raises:
            ValueError: If there are too few.
        """
        largest = max(self.axes_idx)
        if largest >= len(axes):
            raise ValueError(f"expected at least {largest + 1} axes (axes_idx has {largest}), got {len(axes)}")
        return [axes[index] for index in self.axes_idx]


class Mapping(ABC):
    """Turns the axes of a device into the operator's signal.

    Its options are its `Config`, which its constructor takes. It has no memory: equal axes have equal signals.

    Attributes:
        Config: Model of its options.
        size: How many numbers its signal has.
    """

    Config: ClassVar[type[ConfigModel]]
    size: int

    @abstractmethod
    def map(self, axes: Sequence[float]) -> tuple[float, ...]:
        """Returns the signal, `size` numbers, for the axes of a device, which are finite.

        Raises:
            ValueError: If there are too few axes.
        """
