"""A sink that keeps frames in a folder, and asks for the streams that a file there names."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rpbi.render.frame import Camera, Demand, Frame

DEMAND_FILE = "demand.json"


class FolderSink:
    """Writes `CAMERA-TICK.npz` into the folder that `--folder=` names."""

    def __init__(self) -> None:
        self.cameras: set[str] = set()
        self._folder = Path(next(item for item in sys.argv if item.startswith("--folder="))[len("--folder=") :])

    def add(self, camera: Camera) -> None:
        self.cameras.add(camera.name)

    def remove(self, name: str) -> None:
        self.cameras.remove(name)

    def demands(self) -> Mapping[str, Demand]:
        try:
            demands: dict[str, Any] = json.loads((self._folder / DEMAND_FILE).read_text())
        except (FileNotFoundError, json.JSONDecodeError):
            return {}
        return {
            name: Demand(frozenset(streams), seen) for name, (streams, seen) in demands.items() if name in self.cameras
        }

    def write(self, frame: Frame) -> None:
        images = {name: getattr(frame, name) for name in ("colour", "depth", "segmentation")}
        path = self._folder / f"{frame.camera.name}-{frame.tick}.npz"
        unfinished = path.with_suffix(".part")
        with open(unfinished, "wb") as file:
            np.savez(
                file,
                stamp_ns=frame.stamp_ns,
                **{key: item for key, item in images.items() if item is not None},
            )
        unfinished.rename(path)

    def close(self) -> None:
        (self._folder / "closed").touch()
