"""Noise of depth cameras."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt


class DepthNoise(NamedTuple):
    """Normally distributed noise of depths, the same at the same tick whatever was drawn before.

    Its standard deviation at depth z is `constant_m + growth_per_m z^2`: the error of triangulating cameras grows with
    the square of the distance (K. Khoshelham and S. O. Elberink, Accuracy and Resolution of Kinect Depth Data for
    Indoor Mapping Applications, Sensors 12, 2012, eq. 11: 1.425e-3 / m for the Kinect).

    Attributes:
        constant_m: Part of the standard deviation that is the same everywhere [m].
        growth_per_m: Factor on the squared depth [1/m].
        seed: Seed, 0 or greater.
    """

    constant_m: float
    growth_per_m: float
    seed: int

    def add_to(self, depth_m: npt.NDArray[np.float32], tick: int, near_m: float, far_m: float) -> None:
        """Adds the noise of a tick to depths, in place.

        Args:
            depth_m: Depths [m], any shape; those where nothing is, which tell `far_m`, stay as they are.
            tick: The tick.
            near_m: Nearest depth that the camera tells [m].
            far_m: Farthest depth that it tells [m].
        """
        generator = np.random.Generator(np.random.SFC64((self.seed, tick)))
        noise = generator.standard_normal(depth_m.shape, np.float32)
        noise *= np.float32(self.constant_m) + np.float32(self.growth_per_m) * depth_m * depth_m
        noise[depth_m >= np.float32(far_m * (1.0 - 1e-6))] = 0.0
        depth_m += noise
        np.clip(depth_m, np.float32(near_m), np.float32(far_m), out=depth_m)
