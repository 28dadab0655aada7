"""A figure eight."""

from __future__ import annotations

import math

from pydantic import Field

from custom_ros_tools.node_configs import StartParameters
from custom_ros_tools.schema import Hz, NonNegative, Seconds


class FigureEight(StartParameters):
    """A lemniscate of Gerono in the x-y plane of its frame."""

    start_on_init: bool = Field(True, description="Whether it moves from the start on.")
    hz: Hz = Field(50.0, description="How often its frame is broadcast.")
    tf_ns: str = Field("", description="What the names of its frames begin with, such as rpbi.")
    width: NonNegative = Field(0.4, description="From end to end, along y [m].")
    height: NonNegative = Field(0.2, description="Height of each loop, along x [m].")
    period_s: Seconds = Field(10.0, description="Time of one round [s].")

    def position(self, time_s: float) -> tuple[float, float, float]:
        """Returns where it is at a time [s], in its x-y plane [m]."""
        angle = 2.0 * math.pi * time_s / self.period_s
        return self.height * math.sin(angle) * math.cos(angle), self.width / 2.0 * math.sin(angle), 0.0

    def frame(self, name: str) -> str:
        """Returns the full name of one of its frames."""
        return "/".join(part for part in (self.tf_ns.strip("/"), name) if part)
