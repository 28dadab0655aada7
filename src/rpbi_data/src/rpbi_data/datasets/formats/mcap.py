"""rosbag2 recordings in MCAP files: all messages as they were recorded."""

from __future__ import annotations

import io
import shutil
from collections.abc import Iterator
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any, ClassVar, Literal

from pydantic import Field

from custom_ros_tools.errors import MissingDependency
from custom_ros_tools.schema import ConfigModel
from rpbi_data.datasets.format import DatasetError, DatasetFormat, ExportedEpisode, Schema
from rpbi_data.datasets.layouts.mcap import topics_of

try:
    from rosbags.convert import ConverterError, convert
    from rosbags.rosbag2 import Reader, ReaderError
    from rosbags.typesys import Stores, get_typestore
except ImportError:
    raise MissingDependency("rosbags", "./rpbi setup data") from None

ROSBAG2_VERSION = 9
"""Version of the metadata of a recording; that of ROS 2 Jazzy."""


class McapConfig(ConfigModel):
    """Options of rosbag2 recordings."""

    distribution: Literal["humble", "jazzy", "kilted"] = Field(
        "jazzy", description="Distribution of ROS 2 whose messages are used."
    )


class Mcap(DatasetFormat):
    """A folder of rosbag2 recordings in MCAP files, one for each episode, with all topics."""

    Config = McapConfig
    has_rows: ClassVar[bool] = False

    def open(self, folder: Path, schema: Schema | None) -> None:
        """Begins the folder."""
        self._folder = folder
        self._types = get_typestore(Stores[f"ROS2_{self.config.distribution.upper()}"])

    def add(self, index: int, episode: ExportedEpisode) -> dict[str, Any]:
        """Converts the bag of an episode."""
        target = self._folder / f"episode_{index:06d}"
        try:
            _convert(episode.bag, target, self._types)
            topics = topics_of(target)
        except (ConverterError, ReaderError) as error:
            shutil.rmtree(target, ignore_errors=True)
            if isinstance(error.__cause__, OSError):
                raise error.__cause__ from None
            raise DatasetError(episode.bag, f"cannot be converted: {' '.join(str(error).split())}") from error
        except BaseException:
            shutil.rmtree(target, ignore_errors=True)
            raise
        return {"topics": topics}

    def take_back(self, index: int) -> None:
        """Removes the recording that was added last."""
        shutil.rmtree(self._folder / f"episode_{index:06d}")

    def close(self) -> None:
        """Does nothing: a recording is complete after `add`."""

    @classmethod
    def recognises(cls, folder: Path) -> bool:
        """Returns whether there are folders with a `metadata.yaml` or a file of MCAP."""
        return bool([*folder.glob("*/metadata.yaml"), *folder.glob("*/*.mcap")])

    @classmethod
    def faults(cls, folder: Path) -> Iterator[str]:
        """Yields a sentence for each fault."""
        from rpbi_data.datasets.checks.mcap import mcap_faults

        return mcap_faults(folder)

    @classmethod
    def summary(cls, folder: Path) -> str:
        """Returns the number of episodes and messages."""
        found = [_count(each.parent) for each in sorted(folder.glob("*/metadata.yaml"))]
        return f"rosbag2 in MCAP: {len(found)} episodes, {sum(found)} messages"


def _convert(bag: Path, target: Path, types: Any) -> None:
    """Converts all topics of a ROS 1 bag; their definitions are in it."""
    choices = ("exclude_topics", "include_topics", "exclude_msgtypes", "include_msgtypes")
    everything: dict[str, Any] = dict.fromkeys(choices, ())
    plain: dict[str, Any] = {"compress": None, "compress_mode": "message"}
    with redirect_stdout(io.StringIO()):  # it names types that ROS 2 does not have, which are written all the same
        convert([bag], target, "mcap", ROSBAG2_VERSION, default_typestore=None, typestore=types, **plain, **everything)


def _count(recording: Path) -> int:
    with Reader(recording) as reader:
        return int(reader.message_count)
