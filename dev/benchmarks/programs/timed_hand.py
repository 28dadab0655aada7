"""A haptic device whose hand presses repeatedly, and which records the times of reading."""

import time
from array import array

import numpy as np
from pydantic import Field

from operator_node.haptics.device import HapticReading
from operator_node.haptics.devices.scripted import ScriptedConfig, ScriptedDevice
from operator_node.haptics.emulated import EmulatedDevice
from robot_model.geometry import Vector


class TimedConfig(ScriptedConfig):
    """A hand that never ends."""

    file: str = Field(description="Where the times go: seconds of the monotonic clock, for NumPy.")


class TimedHand(ScriptedDevice):
    """Presses until the device is closed."""

    Config = TimedConfig

    def __init__(self, config: TimedConfig) -> None:
        super().__init__(config)
        self._file, self._times = config.file, array("d")

    def goal(self, time_s: float) -> Vector:
        """Returns where the hand wants the handle."""
        return super().goal(time_s % self._press.duration_s)

    def read(self) -> HapticReading | None:
        """Returns the position of the handle."""
        self._times.append(time.monotonic())
        return EmulatedDevice.read(self)

    def close(self) -> None:
        """Lets go of the handle, and writes the file."""
        super().close()
        if self._times:
            np.save(self._file, np.array(self._times))
