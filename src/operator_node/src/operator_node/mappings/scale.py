"""Each axis times a number."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, model_validator

from custom_ros_tools.schema import AlsoTakes, Expects, KeyedError, ListOf

from .mapping import AxesConfig, Mapping


def _one_as_list(given: Any) -> Any:
    return [given] if isinstance(given, (int, float)) and not isinstance(given, bool) else given


class ScaleConfig(AxesConfig):
    """Which axes become the signal, and times what."""

    scale: Annotated[
        ListOf[float],
        BeforeValidator(_one_as_list),
        AlsoTakes({"type": "number"}),
        Expects("a number or a list of numbers"),
    ] = Field((1.0,), description="What to multiply by: one number for all axes, or one for each.")

    @model_validator(mode="after")
    def _one_for_each(self) -> ScaleConfig:
        if len(self.scale) not in (1, len(self.axes_idx)):
            expected = f"expected one number, or {len(self.axes_idx)} as axes_idx has"
            raise KeyedError("scale", f"{expected}, got {len(self.scale)}")
        return self


class ScaleMapping(Mapping):
    """Each axis by itself: `scale * axes[axes_idx]`."""

    Config = ScaleConfig

    def __init__(self, config: ScaleConfig) -> None:
        self._config, self.size = config, len(config.axes_idx)
        self._scale = config.scale if len(config.scale) > 1 else config.scale * self.size

    def map(self, axes: Sequence[float]) -> tuple[float, ...]:
        """Returns the signal, see `Mapping`."""
        return tuple(scale * axis for scale, axis in zip(self._scale, self._config.pick(axes)))
