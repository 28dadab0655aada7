"""Pinhole cameras: projection and view matrices for a renderer, K for ROS, and depth in metres.

The optical frame has x to the right, y down and z forward, as in ROS. The renderer's eye frame (OpenGL) has x to the
right, y up and z backward. Pixel coordinates follow ROS and OpenCV: (u, v) = (0, 0) is the *centre* of the first pixel,
and the image spans [-0.5, width - 0.5] x [-0.5, height - 0.5]. The principal point of a centred camera is therefore
((width - 1) / 2, (height - 1) / 2).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pybullet

from custom_ros_tools.transforms import finite_vector, pose_of
from robot_model import geometry
from rpbi.geometry import Pose

Array = npt.NDArray[np.floating[Any]]

OPTICAL_TO_EYE = np.diag([1.0, -1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Intrinsics:
    """Image size, field of view and depth range of a pinhole camera with square pixels.

    Attributes:
        width_px: Number of columns of the image.
        height_px: Number of rows of the image.
        fov_deg: Vertical field of view [deg], from the upper edge of the first row to the lower edge of the last row.
        near_m: Nearest depth that is drawn [m], along the optical axis.
        far_m: Farthest depth that is drawn [m], along the optical axis; background pixels have this depth.
    """

    width_px: int = 640
    height_px: int = 480
    fov_deg: float = 40.0
    near_m: float = 0.01
    far_m: float = 100.0

    @property
    def projection(self) -> Array:
        """The 4x4 OpenGL projection matrix, from the eye frame to clip space."""
        near, far = self.near_m, self.far_m
        scale = 1.0 / math.tan(math.radians(self.fov_deg) / 2.0)
        matrix = np.zeros((4, 4))
        matrix[0, 0] = scale * self.height_px / self.width_px
        matrix[1, 1] = scale
        matrix[2, 2] = (near + far) / (near - far)
        matrix[2, 3] = 2.0 * near * far / (near - far)
        matrix[3, 2] = -1.0
        return matrix

    @property
    def K(self) -> Array:  # noqa: N802
        """The 3x3 camera matrix from the optical frame to pixels, derived from the projection matrix."""
        return camera_matrix(self.projection, self.width_px, self.height_px)


def camera_matrix(projection: Array, width_px: int, height_px: int) -> Array:
    """Derives the camera matrix K from a projection matrix P.

    A point (x, y, z) in the optical frame is (x, -y, -z) in the eye frame. Dividing the point's clip coordinates by
    w = z gives (P00 x / z - P02, -P11 y / z - P12). Both results range from -1 to 1 between the outer edges of the
    image; the second result increases upwards.

    Args:
        projection: 4x4 matrix from the eye frame to clip space; only P00, P11, P02 and P12 are used.
        width_px: Number of columns of the image.
        height_px: Number of rows of the image.

    Returns:
        3x3 matrix; pixel (0, 0) is the centre of the first pixel.
    """
    fx = projection[0, 0] * width_px / 2.0
    fy = projection[1, 1] * height_px / 2.0
    cx = (1.0 - projection[0, 2]) * width_px / 2.0 - 0.5
    cy = (1.0 + projection[1, 2]) * height_px / 2.0 - 0.5
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def looking_at(position: Sequence[float], target: Sequence[float]) -> Pose:
    """Returns the optical frame's pose, in the world frame, for a camera that looks at a target with a level horizon.

    If the camera looks straight up or down, the world's x axis points to the right in the image.

    Args:
        position: Position of the camera in the world frame, x, y, z [m].
        target: Point at the centre of the image, x, y, z in the world frame [m].

    Raises:
        ValueError: If position and target are the same, or one of them does not consist of three finite numbers.
    """
    eye = finite_vector(position, 3, "position")
    forward = finite_vector(target, 3, "target") - eye
    distance = np.linalg.norm(forward)
    if distance < 1e-9:
        raise ValueError(f"target: must not be where the camera is, got {tuple(eye.tolist())} twice")
    forward /= distance
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right = right / np.linalg.norm(right) if np.linalg.norm(right) > 1e-6 else np.array((1.0, 0.0, 0.0))
    T = np.eye(4)
    T[:3, :3] = np.stack((right, np.cross(forward, right), forward), axis=1)
    quat = pose_of(T)[1].tolist()
    return Pose(tuple(eye.tolist()), tuple(quat))


def view_matrix(camera: geometry.Pose) -> Array:
    """Returns the 4x4 OpenGL view matrix, from the world frame to the eye frame.

    Args:
        camera: Pose of the optical frame in the world frame.
    """
    rotation = np.reshape(pybullet.getMatrixFromQuaternion(camera.quat_xyzw), (3, 3))
    optical_from_world = np.eye(4)
    optical_from_world[:3, :3] = rotation.T
    optical_from_world[:3, 3] = -rotation.T @ np.asarray(camera.position)
    return OPTICAL_TO_EYE @ optical_from_world


def depth_in_metres(buffer: npt.NDArray[np.float32], intrinsics: Intrinsics) -> npt.NDArray[np.float32]:
    """Converts a depth buffer to distances along the optical axis.

    The formula is accurate in single precision, since `1 - buffer` is exact for large depths.

    Args:
        buffer: Depth buffer of the renderer, 0 at the near plane and 1 at the far plane, any shape.
        intrinsics: Intrinsics of the camera, for its near and far plane.

    Returns:
        Depths [m] along z of the optical frame, same shape.
    """
    near, far = np.float32(intrinsics.near_m), np.float32(intrinsics.far_m)
    inverse = np.subtract(np.float32(1.0), buffer)
    inverse *= far
    inverse += near * buffer
    return np.divide(near * far, inverse, out=inverse)


class DepthNoise(NamedTuple):
    """Normally distributed noise of depths, which depends only on the seed and the tick.

    The standard deviation at depth z is `constant_m + growth_per_m z^2`, since the error of triangulating cameras grows
    with the square of the distance (K. Khoshelham and S. O. Elberink, Accuracy and Resolution of Kinect Depth Data for
    Indoor Mapping Applications, Sensors 12, 2012, eq. 11: 1.425e-3 / m for the Kinect).

    Attributes:
        constant_m: Part of the standard deviation [m] that does not depend on the depth.
        growth_per_m: Factor of the squared depth in the standard deviation [1/m].
        seed: Seed, 0 or greater.
    """

    constant_m: float
    growth_per_m: float
    seed: int

    def add_to(self, depth_m: npt.NDArray[np.float32], tick: int, near_m: float, far_m: float) -> None:
        """Adds the noise of a tick to depths, in place.

        Args:
            depth_m: Depths [m], any shape; background pixels, whose depth is `far_m`, do not change.
            tick: Number of the tick.
            near_m: Nearest depth of the camera [m], the lower limit of results.
            far_m: Farthest depth of the camera [m], the upper limit of results.
        """
        generator = np.random.Generator(np.random.SFC64((self.seed, tick)))
        noise = generator.standard_normal(depth_m.shape, np.float32)
        noise *= np.float32(self.constant_m) + np.float32(self.growth_per_m) * depth_m * depth_m
        noise[depth_m >= np.float32(far_m * (1.0 - 1e-6))] = 0.0
        depth_m += noise
        np.clip(depth_m, np.float32(near_m), np.float32(far_m), out=depth_m)


class PointCloud:
    """Converts the images of one camera to points; each call of `of` overwrites the array that `of` returned before."""

    def __init__(self, intrinsics: Intrinsics) -> None:
        K = intrinsics.K
        # A point at depth z of the pixel (u, v) is z ((u - cx) / fx, (v - cy) / fy, 1).
        self._x_of_column = ((np.arange(intrinsics.width_px) - K[0, 2]) / K[0, 0]).astype(np.float32)
        self._y_of_row = ((np.arange(intrinsics.height_px) - K[1, 2]) / K[1, 1]).astype(np.float32)[:, None]
        self._nothing_from_m = np.float32(intrinsics.far_m * (1.0 - 1e-6))  # rounding of the depth buffer
        self._points = np.empty((intrinsics.height_px, intrinsics.width_px, 4), np.float32)
        self._rgb = self._points.view(np.uint8)[..., 12:]

    def of(self, depth_m: npt.NDArray[np.float32], colour: npt.NDArray[np.uint8]) -> npt.NDArray[np.float32]:
        """Converts a depth and a colour image to points.

        Args:
            depth_m: Depths along the optical axis [m], shape (height, width); the far plane for background pixels.
            colour: Red, green and blue from 0 to 255, shape (height, width, 3).

        Returns:
            x, y, z in the optical frame [m] and the packed colour of each pixel, shape (height, width, 4). For
            background pixels, x, y and z are NaN. The bytes of the colour are blue, green, red and 0, as in PCL.
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
