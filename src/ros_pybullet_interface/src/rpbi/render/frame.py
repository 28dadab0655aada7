"""Frames of the renderer process, and the demand for them."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from rpbi.config.sensors import RgbdSensorConfig

from .camera import DepthNoise, Intrinsics


class Camera(NamedTuple):
    """A camera for the renderer.

    Attributes:
        name: Its unique name.
        frame_id: TF frame of its optical frame.
        intrinsics: Its intrinsics.
        topic_name: Its name in topics, which need not be its own.
        pointcloud: Whether point clouds may be asked for.
        synchronous: Whether the simulation waits for its frames, so that none may be dropped.
        noise: Noise of its depths, None for exact ones.
    """

    name: str
    frame_id: str
    intrinsics: Intrinsics
    topic_name: str = ""
    pointcloud: bool = False
    synchronous: bool = False
    noise: DepthNoise | None = None

    @classmethod
    def of(cls, config: RgbdSensorConfig, topic_name: str = "") -> Camera:
        """Returns the camera that a YAML describes."""
        size = config.intrinsics
        noise = None
        if config.depth_noise_m or config.depth_noise_growth_per_m:
            seed = zlib.crc32(config.name.encode()) if config.seed is None else config.seed
            noise = DepthNoise(config.depth_noise_m, config.depth_noise_growth_per_m, seed)
        return cls(
            config.name,
            config.object_tf.tf_id,
            Intrinsics(size.width, size.height, size.fov, *size.range),
            topic_name,
            config.pointcloud,
            config.synchronous,
            noise,
        )


class Frame(NamedTuple):
    """Images of a camera at one tick; None for those without demand.

    Attributes:
        camera: The camera.
        tick: The tick shown.
        stamp_ns: Its stamp [ns].
        colour: Red, green and blue, shape (height, width, 3), uint8.
        depth: Distance along the optical axis [m], shape (height, width), float32; the far plane where
            nothing is.
        segmentation: Body ids of the simulator, -1 where nothing is, shape (height, width), int32.
    """

    camera: Camera
    tick: int
    stamp_ns: int
    colour: npt.NDArray[np.uint8] | None = None
    depth: npt.NDArray[np.float32] | None = None
    segmentation: npt.NDArray[np.int32] | None = None


class Demand(NamedTuple):
    """Demand for the images of a camera.

    Attributes:
        streams: Streams with viewers, out of `colour`, `jpeg` (which needs colour), `depth`, `segmentation`, `points`
            (which need colour and depth) and `info`.
        seen: Number of viewers so far; when it grows, one is new.
    """

    streams: frozenset[str] = frozenset()
    seen: int = 0


NO_DEMAND = Demand()


class Sink(Protocol):
    """Receives the frames, in the renderer process.

    A sink is made by a factory: `--sink module:factory`.
    """

    def add(self, camera: Camera) -> None:
        """Prepares for the frames of a camera."""

    def remove(self, name: str) -> None:
        """Forgets a camera."""

    def demands(self) -> Mapping[str, Demand]:
        """Returns the demands by camera name; cameras left out have none."""

    def write(self, frame: Frame) -> None:
        """Receives a frame; it must not block, unless the camera is synchronous."""

    def close(self) -> None:
        """Ends it."""
