"""Imperfections of tracking systems: latency, noise and occlusion."""

from __future__ import annotations

import zlib
from collections import deque
from typing import Annotated, Generic, TypeVar

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Count, Fraction, NonNegative, Seconds, Unit, optional
from robot_model.geometry import plus, quaternion_of
from rpbi.config.sensors import Deviation, SensorConfig
from rpbi.geometry import Pose
from rpbi.sensors.filters import SeededNoise

Measured = TypeVar("Measured")


class OcclusionConfig(ConfigModel):
    """Occlusion at random times."""

    share: Fraction = Field(description="Fraction of the time during which the object is hidden.")
    length_s: Seconds = Field(
        0.5, description="Length of time intervals; during each interval, the object is either hidden or visible."
    )


class TrackingSensorConfig(SensorConfig):
    """Keys of all sensors that imitate a tracking system."""

    latency_s: Annotated[NonNegative, Unit("s")] = Field(
        0.0,
        description="Delay of messages, rounded up to whole sample periods; their stamps are the times of measurement.",
    )
    noise_m: Annotated[Deviation, Unit("m")] = Field(
        (0.0, 0.0, 0.0),
        description="Standard deviation of the position noise along x, y and z of the frame in which poses are "
        "reported, or one number for all axes.",
    )
    noise_rad: Annotated[NonNegative, Unit("rad")] = Field(
        0.0, description="Standard deviation of the rotation noise about each axis."
    )
    occlusion: OcclusionConfig | None = optional("Occlusion at random times. By default, the object is never hidden.")
    seed: Count | None = optional("Seed of noise and occlusion. By default, computed from the name of the sensor.")

    def seed_of(self, name: str) -> int:
        """Returns the configured seed, or by default a seed computed from the sensor's name."""
        return zlib.crc32(name.encode()) if self.seed is None else self.seed


class Occlusion:
    """Hides a tracked object at random times, which depend only on the seed.

    Args:
        config: Share of time and length of occlusions; None to never hide the object.
        seed: Seed, 0 or greater.
        dt_s: Length of a tick [s].
    """

    def __init__(self, config: OcclusionConfig | None, seed: int, dt_s: float) -> None:
        self._share = 0.0 if config is None else config.share
        self._ticks = 1 if config is None else max(1, round(config.length_s / dt_s))
        self._seed = seed

    def hides(self, tick: int) -> bool:
        """Returns whether the tracked object is hidden at a tick."""
        if not self._share:
            return False
        return bool(np.random.default_rng((self._seed, tick // self._ticks)).random() < self._share)


class PoseNoise:
    """Adds noise to poses; the noise depends only on the seed and the tick.

    Args:
        config: Configuration with the standard deviations [m, rad].
        seed: Seed, 0 or greater.
    """

    def __init__(self, config: TrackingSensorConfig, seed: int) -> None:
        self._noise = SeededNoise(seed, (*config.noise_m, *[config.noise_rad] * 3), [0.0] * 6)

    def on(self, pose: Pose, tick: int) -> Pose:
        """Returns `pose` with the noise of a tick added."""
        x, y, z, *turn = self._noise.at(tick).tolist()
        rotated = Pose((0.0, 0.0, 0.0), quaternion_of((turn[0], turn[1], turn[2]))) @ Pose(
            (0.0, 0.0, 0.0), pose.quat_xyzw
        )
        return Pose(plus(pose.position, (x, y, z)), rotated.quat_xyzw)


class Delay(Generic[Measured]):
    """Buffers measurements until they have a minimum age.

    Args:
        ticks: Minimum age of a returned measurement [ticks].
    """

    def __init__(self, ticks: int) -> None:
        self._ticks = ticks
        self._waiting: deque[tuple[int, Measured]] = deque()

    def push(self, tick: int, measured: Measured) -> None:
        """Adds the measurement of a tick; a second measurement of the same tick is ignored."""
        if not self._waiting or self._waiting[-1][0] != tick:
            self._waiting.append((tick, measured))

    def newest(self, tick: int) -> tuple[int, Measured] | None:
        """Returns the newest measurement that is old enough at `tick`, as a pair of its tick and the measurement.

        Returns None if all measurements are too new.
        """
        while len(self._waiting) > 1 and tick - self._waiting[1][0] >= self._ticks:
            self._waiting.popleft()
        first = self._waiting[0] if self._waiting else None
        return first if first is not None and tick - first[0] >= self._ticks else None
