"""Renders the images of a world's cameras, for observations and for `render`."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from custom_ros_tools.errors import ConfigError, Problem, UnknownNameError
from rpbi.images import CameraImages
from rpbi.world import World

Image = npt.NDArray[Any]


class Views:
    """Renders the cameras of a world on demand.

    Args:
        world: The world.
        names: Cameras whose images are in observations.
        mode: Render mode: `rgb_array`, `human`, or None.
        period_s: Minimum wall time [s] between two returns of `render` in mode `human`.

    Attributes:
        spaces: Space of each image of an observation: `CAMERA/colour`, uint8, shape (height, width, 3), and
            `CAMERA/depth` [m], float32, shape (height, width).

    Raises:
        ConfigError: If images are needed, but no camera has a pose.
        UnknownNameError: If the world does not have one of the cameras.
    """

    def __init__(self, world: World, names: Sequence[str], mode: str | None, period_s: float) -> None:
        self._world, self._names, self._mode, self._period_s = world, tuple(names), mode, period_s
        self._shown_s = 0.0
        if (names or mode == "rgb_array") and not any(camera.pose for camera in world.cameras.values()):
            message = "expected a camera with a pose in `poses`, for its images; got none"
            raise ConfigError([Problem(world.loaded.file, "rgbd_sensor", message)])
        self._images: CameraImages | None = None
        self.spaces: dict[str, spaces.Space[Any]] = {}
        for name in self._names:
            if name not in world.cameras:
                raise UnknownNameError("camera", name, list(world.cameras))
            intrinsics = world.cameras[name].config.intrinsics
            shape = (intrinsics.height, intrinsics.width)
            self.spaces[f"{name}/colour"] = spaces.Box(0, 255, (*shape, 3), np.uint8)
            self.spaces[f"{name}/depth"] = spaces.Box(0.0, float(intrinsics.range[1]), shape, np.float32)

    def read(self) -> dict[str, Image]:
        """Returns the present images, indexed by the keys of `spaces`."""
        images: dict[str, Image] = {}
        for name in self._names:
            frame = self._drawn(name)
            images[f"{name}/colour"], images[f"{name}/depth"] = frame.colour, frame.depth
        return images

    def render(self) -> Image | None:
        """Returns the image of the world's first camera, uint8, shape (height, width, 3); None if `mode` is None.

        In mode `human`, waits instead until `period_s` has passed since the last call, and returns None.
        """
        if self._mode == "rgb_array":
            colour: Image = self._drawn("").colour
            return colour
        if self._mode == "human":
            time.sleep(max(0.0, self._shown_s + self._period_s - time.monotonic()))
            self._shown_s = time.monotonic()
        return None

    def close(self) -> None:
        """Closes the renderer, if there is one."""
        if self._images is not None:
            self._images.close()
            self._images = None

    def _drawn(self, name: str) -> Any:
        if self._images is None:
            self._images = CameraImages(self._world)
        return self._images.frame(name)
