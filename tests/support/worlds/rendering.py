"""A small world and its renderer process, for tests."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pybullet
from frame_sink import DEMAND_FILE

from robot_model.geometry import Quaternion
from rpbi.geometry import Pose
from rpbi.render.camera import Intrinsics
from rpbi.render.client import RenderClient
from rpbi.render.frame import Camera, Demand
from rpbi.samples import SceneSample
from rpbi.world import World

INTRINSICS = Intrinsics(width_px=320, height_px=240, fov_deg=50.0, near_m=0.01, far_m=100.0)
CAMERA = Camera("eye", "rpbi/eye", INTRINSICS)
ALL = ("colour", "depth", "segmentation")

Array = npt.NDArray[np.floating[Any]]


def rotation_matrix(quat_xyzw: Quaternion) -> Array:
    """Returns the 3x3 rotation of a unit quaternion."""
    return np.reshape(pybullet.getMatrixFromQuaternion(quat_xyzw), (3, 3))


def project(points: Array, camera: Pose, K: Array) -> Array:
    """Projects points of the world [m], shape (n, 3), into the image of a camera whose optical frame has that pose.

    Returns:
        Pixels and depth (u, v, z) [px, px, m], shape (n, 3); z <= 0 is behind the camera and its pixels mean nothing.
    """
    in_camera = (np.asarray(points) - np.asarray(camera.position)) @ rotation_matrix(camera.quat_xyzw)
    depth = in_camera[:, 2:]
    return np.hstack([(in_camera @ K.T)[:, :2] / depth, depth])


def back_project(depth_m: Array, K: Array) -> Array:
    """Returns the points in the optical frame [m] that pixels of these depths [m] see, shape (height, width, 3)."""
    height, width = depth_m.shape
    x = (np.arange(width, dtype=depth_m.dtype) - K[0, 2]) / K[0, 0]
    y = (np.arange(height, dtype=depth_m.dtype) - K[1, 2]) / K[1, 1]
    return np.stack([depth_m * x, depth_m * y[:, None], depth_m], axis=-1)


class Rendering:
    """A world with a renderer process whose frames come as files.

    Args:
        folder: Where to write.
        world: The world.
        cameras: Its cameras.
        use_egl: Whether to try EGL.
        gives_way: Whether others go first; what it draws is asked here as a rule, not who goes first.
    """

    def __init__(
        self,
        folder: Path,
        world: World,
        cameras: tuple[Camera, ...] = (CAMERA,),
        use_egl: bool = True,
        gives_way: bool = False,
    ) -> None:
        self.folder = folder
        self.world = world
        self.tick = 0
        self.client = RenderClient(
            cameras,
            world.log,
            lambda: {name: body.body_id for name, body in world.bodies.items()},
            "frame_sink:FolderSink",
            [*([] if gives_way else ["--keep-priority"]), f"--folder={folder}"],
            use_egl,
        )

    def demand(self, *streams: str, camera: str = "eye", seen: int = 1) -> None:
        """Asks for streams of a camera and waits until the client knows."""
        unfinished = self.folder / "demand.part"
        unfinished.write_text(json.dumps({camera: [streams, seen]}))
        unfinished.rename(self.folder / DEMAND_FILE)
        wanted = Demand(frozenset(streams), seen)
        self.until(lambda: self.client._demands.get(camera) == wanted, "the demand is known")

    def sample(self, pose: Pose = Pose(), camera: str = "eye") -> SceneSample:
        """Returns what a camera would see now."""
        self.tick += 1
        return SceneSample(
            camera,
            self.tick,
            1000 * self.tick,
            pose,
            tuple(body.state() for body in self.world.bodies.values()),
        )

    def look(self, pose: Pose = Pose()) -> Any:
        """Returns the frame of the world as it is now."""
        sample = self.sample(pose)
        self.client.send(sample)
        return self.frame(sample.tick)

    def frame(self, tick: int) -> Any:
        """Waits for the frame of a tick."""
        path = self.folder / f"eye-{tick}.npz"
        self.until(path.exists, f"{path.name} came")
        return np.load(path)

    def until(self, condition: Callable[[], Any], what: str, timeout_s: float = 120.0) -> None:
        """Looks after the process until a condition holds."""
        end_s = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < end_s, f"it did not come about that {what}"
            self.client.poll()
            time.sleep(0.002)

    def close(self) -> None:
        """Ends everything."""
        self.client.stop()
        self.world.close()
