"""Images of a world's cameras, as parts of observations and as frames to look at."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from custom_ros_tools.errors import UnknownNameError
from rpbi.images import CameraImages
from rpbi.world import World

Image = npt.NDArray[Any]


class Views:
    """Draws what cameras of a world see, once somebody asks.

    Args:
        world: The world.
        names: Cameras whose images are in observations.

    Attributes:
        spaces: Space of each image of an observation: `CAMERA/colour`, uint8, shape (height, width, 3), and
            `CAMERA/depth` [m], float32, shape (height, width).

    Raises:
        UnknownNameError: If the world has no such camera.
    """

    def __init__(self, world: World, names: Sequence[str]) -> None:
        self._world, self._names = world, tuple(names)
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
        """Returns the present images by name."""
        images: dict[str, Image] = {}
        for name in self._names:
            frame = self._drawn(name)
            images[f"{name}/colour"], images[f"{name}/depth"] = frame.colour, frame.depth
        return images

    def frame(self) -> Image:
        """Returns what the first camera of the world sees, uint8, shape (height, width, 3)."""
        colour: Image = self._drawn("").colour
        return colour

    def close(self) -> None:
        """Ends the renderer, if there is one."""
        if self._images is not None:
            self._images.close()
            self._images = None

    def _drawn(self, name: str) -> Any:
        if self._images is None:
            self._images = CameraImages(self._world)
        return self._images.frame(name)
