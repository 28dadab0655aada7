"""Noise of depth images, and point clouds."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from .camera import Intrinsics


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
            depth_m: Depths [m], any shape; those of empty pixels, `far_m`, stay as they are.
            tick: The tick.
            near_m: Nearest depth of the camera [m].
            far_m: Farthest depth of the camera [m].
        """
        generator = np.random.Generator(np.random.SFC64((self.seed, tick)))
        noise = generator.standard_normal(depth_m.shape, np.float32)
        noise *= np.float32(self.constant_m) + np.float32(self.growth_per_m) * depth_m * depth_m
        noise[depth_m >= np.float32(far_m * (1.0 - 1e-6))] = 0.0
        depth_m += noise
        np.clip(depth_m, np.float32(near_m), np.float32(far_m), out=depth_m)


class PointCloud:
    """Turns the images of one camera into points, in place and all at once."""

    def __init__(self, intrinsics: Intrinsics) -> None:
        K = intrinsics.K
        # A point at depth z of the pixel (u, v) is z ((u - cx) / fx, (v - cy) / fy, 1).
        self._x_of_column = ((np.arange(intrinsics.width_px) - K[0, 2]) / K[0, 0]).astype(np.float32)
        self._y_of_row = ((np.arange(intrinsics.height_px) - K[1, 2]) / K[1, 1]).astype(np.float32)[:, None]
        self._nothing_from_m = np.float32(intrinsics.far_m * (1.0 - 1e-6))  # rounding of the depth buffer
        self._points = np.empty((intrinsics.height_px, intrinsics.width_px, 4), np.float32)
        self._rgb = self._points.view(np.uint8)[..., 12:]

    def of(self, depth_m: npt.NDArray[np.float32], colour: npt.NDArray[np.uint8]) -> npt.NDArray[np.float32]:
        """Returns the points of a frame.

        Args:
            depth_m: Depths z [m], shape (height, width); the far plane where nothing is.
            colour: Red, green and blue, shape (height, width, 3).

        Returns:
            x, y, z in the optical frame [m] and the colour, whose four bytes are blue, green, red and 0 as PCL has
            them; NaN in x, y and z where nothing is; shape (height, width, 4). The next call overwrites it.
        """
        z = self._points[..., 2]
        np.copyto(z, depth_m)
        z[depth_m >= self._nothing_from_m] = np.nan
        np.multiply(z, self._x_of_column, out=self._points[..., 0])
        np.multiply(z, self._y_of_row, out=self._points[..., 1])
        for channel in range(3):  # four times as fast as copying pixel by pixel
            self._rgb[..., channel] = colour[..., 2 - channel]
        self._rgb[..., 3] = 0
        return self._points
