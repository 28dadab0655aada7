"""The controlled system, as the loop sees it: simulated, or real."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np


class Sensed(NamedTuple):
    """A measurement.

    Attributes:
        time_s: Time of the plant at which it is available [s].
        values: The measured numbers, in the order and units of the controller; None if something is missing.
        missing: What is missing, as a clause such as `vicon/box/box: no pose for 0.52 s, expected one every 0.01 s`.
        age_s: Time between measurement and `time_s` [s].
    """

    time_s: float
    values: np.ndarray | None
    missing: str = ""
    age_s: float = 0.0


class Plant(ABC):
    """A system that is measured and commanded, and that advances in time.

    Attributes:
        is_timed: Whether time passes by itself, as for hardware. Then late plans are discarded; otherwise the plant
            waits, and no decision depends on the speed of the computer.
    """

    is_timed = False

    @abstractmethod
    def sense(self) -> Sensed:
        """Returns the newest measurement."""

    @abstractmethod
    def act(self, command: np.ndarray) -> None:
        """Applies a command until the next one."""

    @abstractmethod
    def stand(self) -> None:
        """Stops the plant until the next command."""

    @abstractmethod
    def advance(self, duration_s: float) -> None:
        """Lets time pass: steps a simulation by as many ticks, or waits on hardware."""
