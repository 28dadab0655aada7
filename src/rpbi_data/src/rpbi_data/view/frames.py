"""Reads the poses of TF frames from the tables of a recording."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
import pandas as pd

from custom_ros_tools.errors import UnknownNameError
from rpbi.config.world import WORLD_FRAME
from rpbi_data.bags.transforms import ROTATION, TRANSLATION, transforms_between

from .scene import Array, Poses


class Frames:
    """Computes the poses of TF frames in the world frame at given times.

    Args:
        tables: Tables of a bag, of which only `/tf` and `/tf_static` are read.
        own: Frames of the simulator, without TF prefix, from which the recorded TF prefix is determined.
        times: Times of the poses, ascending, shape (n,) [s].
    """

    def __init__(self, tables: Mapping[str, pd.DataFrame], own: Collection[str], times: Array) -> None:
        self.times = times
        self.notes: list[str] = []
        self._tables = tables
        tf = [tables[topic] for topic in ("/tf", "/tf_static") if topic in tables]
        self._known = {name for table in tf for column in ("parent", "child") for name in table[column].unique()}
        prefixes = {name.removesuffix(WORLD_FRAME) for name in self._known if name.endswith(WORLD_FRAME)}
        self._prefix = max(
            sorted(prefixes), key=lambda each: sum(each + name in self._known for name in own), default=""
        )
        self._found: dict[str, Poses | None] = {}

    def poses(self, frame: str) -> Poses | None:
        """Returns the poses of a frame, or None if TF has no transform from the world frame to the frame.

        Outside the time range of the transforms, the frame keeps its first or last pose.

        Args:
            frame: Name of the frame, with or without the TF prefix.
        """
        name = self._prefix + frame if self._prefix + frame in self._known else frame
        if name not in self._found:
            self._found[name] = self._read(name)
        return self._found[name]

    def _read(self, name: str) -> Poses | None:
        try:
            known = transforms_between(self._tables, self._prefix + WORLD_FRAME, name)
        except UnknownNameError:
            return None
        except ValueError as error:
            self.notes.append(f"{name} is not on TF in a way that can be used: {error}")
            return None
        if known.empty:
            return None
        inside = np.clip(self.times, known.index[0], known.index[-1])
        rows = transforms_between(self._tables, self._prefix + WORLD_FRAME, name, times=np.unique(inside))
        return Poses.from_numbers(rows[[*TRANSLATION, *ROTATION]].reindex(inside, method="nearest").to_numpy())
