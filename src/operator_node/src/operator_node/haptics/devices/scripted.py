"""A hand that presses and releases by itself, for demonstrations and tests."""

import random

from pydantic import Field

from custom_ros_tools.schema import Count, Metres, NonNegative, Positive, PositiveMetres
from operator_node.haptics.device import DeviceEnded, HapticConfig, HapticReading
from operator_node.haptics.hand import Hand, Press
from rpbi.geometry import Vector

from .emulated import EmulatedDevice

SPREAD = 0.15
"""By so much depths, times and the hand itself differ from seed to seed."""


class ScriptedConfig(HapticConfig):
    """A hand that presses once and releases."""

    max_force_n: Positive = Field(10.0, description="The largest force that it is sent [N].")
    workspace_m: PositiveMetres = Field(0.1, description="Radius of its workspace.")
    resolution_m: NonNegative = Field(0.0, description="It is exact [m].")
    seed: Count = Field(0, description="Of what differs from press to press.")
    depth_m: Metres = Field(0.04, description="How far down the hand goes; some 15 % more or less by the seed.")
    hold_s: Positive = Field(1.2, description="How long it stays below [s]; some 15 % more or less by the seed.")
    wait_s: NonNegative = Field(0.5, description="How long it stays above, before and after [s].")


class ScriptedDevice(EmulatedDevice):
    """Presses and releases, and then is done."""

    Config = ScriptedConfig

    def __init__(self, config: ScriptedConfig) -> None:
        super().__init__(config)
        draw = random.Random(config.seed)
        some = [draw.uniform(1.0 - SPREAD, 1.0 + SPREAD) for _ in range(5)]
        self._press = Press(config.depth_m * some[0], config.wait_s, 1.2 * some[1], config.hold_s * some[2])
        self._hand = Hand(0.3 * some[3], 400.0 * some[4])

    def make_hand(self) -> Hand:
        """Returns the hand of this seed."""
        self._hand.position = self._hand.velocity = (0.0, 0.0, 0.0)
        return self._hand

    def wanted(self, time_s: float) -> Vector:
        """Returns where the hand wants the handle."""
        return self._press.wanted(time_s)

    def read(self) -> HapticReading | None:
        """Returns where the handle is.

        Raises:
            DeviceEnded: When the hand has come back.
        """
        if self._now_s - self._start_s > self._press.duration_s:
            raise DeviceEnded("scripted", "pressed and released")
        return super().read()
