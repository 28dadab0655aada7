"""Cameras and frames in the renderer process, the demand for images, and the interface of sinks."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from rpbi.config.sensors import RgbdSensorConfig

from .camera import DepthNoise, Intrinsics


class Camera(NamedTuple):
    """A camera, as the renderer process needs it.

    Attributes:
        name: Unique name of the camera.
        frame_id: Name of the camera's optical frame on TF.
        intrinsics: Intrinsics of the camera.
        topic_name: Name of the camera in the names of topics, which may differ from `name`.
        pointcloud: Whether the camera has a point cloud topic.
        synchronous: Whether the simulation waits for every frame; otherwise frames may be dropped.
        noise: Noise of the depth image; None for exact depths.
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
        """Creates a camera from its YAML configuration and its name in topics."""
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
    """Images of a camera at one tick; images that were not requested are None.

    Attributes:
        camera: The camera.
        tick: Number of the tick.
        stamp_ns: Stamp of the tick [ns].
        colour: Red, green and blue from 0 to 255, shape (height, width, 3), uint8.
        depth: Distances along the optical axis [m], shape (height, width), float32; the far plane for background.
        segmentation: Body ids in the simulator, shape (height, width), int32; -1 for background.
    """

    camera: Camera
    tick: int
    stamp_ns: int
    colour: npt.NDArray[np.uint8] | None = None
    depth: npt.NDArray[np.float32] | None = None
    segmentation: npt.NDArray[np.int32] | None = None


class Demand(NamedTuple):
    """Those streams of a camera that have viewers, for instance ROS subscribers.

    Attributes:
        streams: Streams with viewers, a subset of `colour`, `jpeg`, `depth`, `segmentation`, `points` and `info`. For
            `jpeg`, the colour image is drawn; for `points`, colour and depth.
        seen: Number of viewers that have ever connected, which increases with each new viewer.
    """

    streams: frozenset[str] = frozenset()
    seen: int = 0


NO_DEMAND = Demand()


class Sink(Protocol):
    """Receives frames in the renderer process, for instance to publish or store them.

    The argument `--sink module:factory` names the function that creates the sink.
    """

    def add(self, camera: Camera) -> None:
        """Prepares to receive the frames of a new camera."""

    def remove(self, name: str) -> None:
        """Handles the removal of a camera."""

    def demands(self) -> Mapping[str, Demand]:
        """Returns the demand for each camera's images, indexed by camera name; missing cameras have no viewers."""

    def write(self, frame: Frame) -> None:
        """Receives a frame; may block only if the camera is synchronous."""

    def close(self) -> None:
        """Releases all resources of the sink."""
