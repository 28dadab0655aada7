"""Mapping that multiplies each axis by a factor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from pydantic import Field, model_validator

from custom_ros_tools.schema import AlsoTakes, Expects, KeyedError, ListOf, OneAsList

from .mapping import AxesConfig, Mapping


class ScaleConfig(AxesConfig):
    """Selection of a device's axes for the signal, and a factor for each axis."""

    scale: Annotated[
        ListOf[float],
        OneAsList,
        AlsoTakes({"type": "number"}),
        Expects("a number or a list of numbers"),
    ] = Field((1.0,), description="Factors of the axes: one number for all axes, or one for each.")

    @model_validator(mode="after")
    def _one_for_each(self) -> ScaleConfig:
        if len(self.scale) not in (1, len(self.axes_idx)):
            expected = f"expected one number, or {len(self.axes_idx)} as axes_idx has"
            raise KeyedError("scale", f"{expected}, got {len(self.scale)}")
        return self

    @property
    def factors(self) -> tuple[float, ...]:
        """Factor for each axis in `axes_idx`."""
        return tuple(self.scale) if len(self.scale) > 1 else tuple(self.scale) * len(self.axes_idx)


class ScaleMapping(Mapping):
    """Multiplies each selected axis by a factor: `scale * axes[axes_idx]`."""

    Config = ScaleConfig

    def __init__(self, config: ScaleConfig) -> None:
        self._config, self.size = config, len(config.axes_idx)
        self._scale = config.factors

    def map(self, axes: Sequence[float]) -> tuple[float, ...]:
        """Returns the scaled axes, see `Mapping.map`."""
        return tuple(scale * axis for scale, axis in zip(self._scale, self._config.pick(axes)))
