"""A format of data sets of a user's own: a CSV file for each episode."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import ConfigModel
from rpbi_data.datasets.format import DatasetFormat, ExportedEpisode, Schema


class TableConfig(ConfigModel):
    """Options of tables."""

    digits: int = Field(6, ge=1, description="Digits behind the point.")


class TableFormat(DatasetFormat):
    """A CSV file for each episode."""

    Config = TableConfig

    def open(self, folder: Path, schema: Schema | None) -> None:
        self.folder = folder

    def add(self, index: int, episode: ExportedEpisode) -> dict[str, Any]:
        states = episode.values({})["observation.state"]
        np.savetxt(self.folder / f"{index}.csv", states, fmt=f"%.{self.config.digits}f")
        return {"frames": len(states)}

    def close(self) -> None:
        pass

    @classmethod
    def recognises(cls, folder: Path) -> bool:
        return bool(list(folder.glob("*.csv")))

    @classmethod
    def faults(cls, folder: Path) -> Iterator[str]:
        for path in sorted(folder.glob("*.csv")):
            if not path.stat().st_size:
                yield f"{path.name}: is empty"

    @classmethod
    def summary(cls, folder: Path) -> str:
        return f"{len(list(folder.glob('*.csv')))} tables"
