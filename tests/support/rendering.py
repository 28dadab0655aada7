"""A small world and its renderer process, for tests."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from frame_sink import DEMAND_FILE

from rpbi.geometry import Pose
from rpbi.render.camera import Intrinsics
from rpbi.render.client import RenderClient
from rpbi.render.frame import Camera, Demand
from rpbi.samples import SceneSample
from rpbi.world import World

INTRINSICS = Intrinsics(width_px=320, height_px=240, fov_deg=50.0, near_m=0.01, far_m=100.0)
CAMERA = Camera("eye", "rpbi/eye", INTRINSICS)
ALL = ("colour", "depth", "segmentation")


class Rendering:
    """A world with a renderer process whose frames come as files.

    Args:
        folder: Where to write.
        world: The world.
        cameras: Its cameras.
        use_egl: Whether to try EGL.
    """

    def __init__(
        self, folder: Path, world: World, cameras: tuple[Camera, ...] = (CAMERA,), use_egl: bool = True
    ) -> None:
        self.folder = folder
        self.world = world
        self.tick = 0
        self.client = RenderClient(
            cameras,
            world.log,
            lambda: {name: body.body_id for name, body in world.bodies.items()},
            "frame_sink:FolderSink",
            [f"--folder={folder}"],
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

    def until(self, condition: Callable[[], Any], what: str, timeout_s: float = 60.0) -> None:
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
