"""A haptic device whose simulated hand presses and releases by itself, for demonstrations and tests."""

import random

from pydantic import Field

from custom_ros_tools.schema import Count, Metres, NonNegative, Positive, PositiveMetres
from operator_node.haptics.device import DeviceEnded, HapticConfig, HapticReading
from operator_node.haptics.emulated import EmulatedDevice, Hand, PressMotion
from robot_model.geometry import Vector

SPREAD = 0.15
"""Largest share by which depth, times and the hand's properties vary with the seed."""


class ScriptedConfig(HapticConfig):
    """Options of the scripted device, whose hand presses once and releases."""

    max_force_n: Positive = Field(10.0, description="Largest force that is sent to the device [N].")
    workspace_m: PositiveMetres = Field(0.1, description="Radius of the device's workspace.")
    resolution_m: NonNegative = Field(
        0.0, description="Resolution of each measured axis [m]; 0 means exact measurements."
    )
    seed: Count = Field(0, description="Seed of the random variation of the press.")
    depth_m: Metres = Field(0.04, description="Depth of the press; the depth varies by about 15 % with the seed.")
    hold_s: Positive = Field(
        1.2, description="Time for which the hand stays pressed down [s]; the time varies by about 15 % with the seed."
    )
    wait_s: NonNegative = Field(0.5, description="Time for which the hand stays up before and after the press [s].")


class ScriptedDevice(EmulatedDevice):
    """Simulated device whose hand presses down and releases once. Then the device ends."""

    Config = ScriptedConfig

    def __init__(self, config: ScriptedConfig) -> None:
        super().__init__(config)
        draw = random.Random(config.seed)
        some = [draw.uniform(1.0 - SPREAD, 1.0 + SPREAD) for _ in range(5)]
        self._press = PressMotion(config.depth_m * some[0], config.wait_s, 1.2 * some[1], config.hold_s * some[2])
        self._hand = Hand(0.3 * some[3], 400.0 * some[4])

    def make_hand(self) -> Hand:
        """Returns the hand, whose properties depend on the seed, at rest in the middle of the workspace."""
        self._hand.position = self._hand.velocity = (0.0, 0.0, 0.0)
        return self._hand

    def goal(self, time_s: float) -> Vector:
        """Returns the position to which the hand pulls the handle [m], `time_s` [s] after `open`."""
        return self._press.goal(time_s)

    def read(self) -> HapticReading | None:
        """Returns the state of the handle.

        Raises:
            DeviceEnded: When the hand has returned to its start.
        """
        if self._now_s - self._start_s > self._press.duration_s:
            raise DeviceEnded("scripted", "pressed and released")
        return super().read()
