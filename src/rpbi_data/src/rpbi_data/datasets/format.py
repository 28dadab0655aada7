"""Base of the formats of data sets, and the episodes that they write."""

from __future__ import annotations

import errno
import os
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from custom_ros_tools.schema import ConfigModel
from rpbi_data.bags.times import PER_SECOND
from rpbi_data.episodes.errors import EpisodeError

Array = NDArray[Any]

STATE, ACTION = "observation.state", "action"
IMAGES = "observation.images."
STAMP, TIME_ERROR = "source.stamp", "source.time_error"
"""Features of the rows themselves: their time in the clock of the recording, and the time error of each feature [s]."""
STAMP_NAMES = ("sec", "nsec")
"""Numbers of a stamp, int64; LeRobot's reader returns numbers with a point in single precision."""
QUATERNION = ("qx", "qy", "qz", "qw")
"""Names of the four parts of a quaternion, as they follow each other in a feature."""


@dataclass(eq=False)
class DatasetError(EpisodeError):
    """A data set cannot be written or read."""


def stamps_of(times: Array) -> Array:
    """Returns seconds and nanoseconds, shape (n, 2), int64, of times [ns], shape (n,)."""
    return np.stack(np.divmod(times, PER_SECOND), axis=1)


class Feature(NamedTuple):
    """Numbers of each row.

    Attributes:
        key: Its name in the data set, such as `observation.state`.
        names: Names of the numbers, such as those of joints.
        dtype: Type of the numbers.
    """

    key: str
    names: tuple[str, ...]
    dtype: str = "float32"


class CameraFeature(NamedTuple):
    """Images of each row, of 8 bits in red, green and blue.

    Attributes:
        key: Its name in the data set, such as `observation.images.camera`.
        height: Rows of pixels, an even number.
        width: Columns of pixels, an even number.
    """

    key: str
    height: int
    width: int


class Schema(NamedTuple):
    """Content of the rows of all episodes of a data set.

    Attributes:
        fps: Rows a second.
        features: Features of numbers.
        cameras: Features of images.
    """

    fps: int
    features: tuple[Feature, ...]
    cameras: tuple[CameraFeature, ...] = ()


class ImageFrame(NamedTuple):
    """An image of a row.

    Attributes:
        pixels: Shape (height, width, 3), uint8.
        stamp: Time of the image in the clock of the recording [ns].
    """

    pixels: Array
    stamp: int


class ExportedEpisode(ABC):
    """An episode, as a format writes it.

    Attributes:
        bag: The recording.
        task: The task in words.
        label: Label of the episode, such as `success`.
    """

    bag: Path
    task: str
    label: str

    @property
    @abstractmethod
    def times(self) -> Array:
        """Times of the rows in the clock of the recording, int64, shape (n,) [ns]."""

    @abstractmethod
    def frames(self, key: str) -> Iterator[ImageFrame]:
        """Yields the n images of a camera, each the newest one at the time of its row.

        Raises:
            InterfaceError: If an image cannot be read.
        """

    @abstractmethod
    def values(self, image_stamps: Mapping[str, Array]) -> dict[str, Array]:
        """Returns the numbers of all features by key, each of shape (n, number of names).

        Args:
            image_stamps: Times of the images of each camera, int64, shape (n,) [ns].
        """


def require_room(folder: Path, size: int) -> None:
    """Raises an OSError if the disk of a folder lacks space for a number of bytes, by reserving it."""
    with tempfile.TemporaryFile(dir=folder) as file:
        os.posix_fallocate(file.fileno(), 0, size)


class DatasetFormat(ABC):
    """A format of data sets: it writes episodes into a folder, recognises such folders and checks them.

    `open`, `add` for each episode and `close` are called in this order. Each episode that was added stays complete
    when a later `add` fails. On a full disk, the last one may be taken back, and `close` called again.

    Args:
        config: Its options.
    """

    Config: ClassVar[type[ConfigModel]] = ConfigModel
    has_rows: ClassVar[bool] = True
    """Whether it writes rows of one rate. Otherwise it only reads the bags, and the schema is None."""
    content: ClassVar[str] = "files of another format"
    """Content by which a folder is recognised, in words, for the message about a folder of no known format."""

    def __init__(self, config: Any) -> None:
        self.config = config

    @abstractmethod
    def open(self, folder: Path, schema: Schema | None) -> None:
        """Begins a data set in an empty folder."""

    @abstractmethod
    def add(self, index: int, episode: ExportedEpisode) -> dict[str, Any]:
        """Writes an episode.

        Args:
            index: Its number in the data set, from 0 on without gaps.
            episode: The episode.

        Returns:
            What is stored about it in `rpbi/`, see `rpbi_data.datasets.provenance`.

        Raises:
            InterfaceError: If the episode cannot be read; nothing of it is in the folder then.
            OSError: If it cannot be written; nothing of it is in the folder then.
        """

    def take_back(self, index: int) -> None:
        """Removes the episode that was added last; at most once after each `add`, also after a `close` that failed.

        Raises:
            OSError: If that cannot be done, as here; there is no data set then.
        """
        raise OSError(errno.ENOSPC, f"no room to complete episode {index}")

    @abstractmethod
    def close(self) -> None:
        """Completes the data set.

        Raises:
            OSError: If it cannot be written.
        """

    @classmethod
    @abstractmethod
    def recognises(cls, folder: Path) -> bool:
        """Returns whether a folder has a data set of this format, written by any tool."""

    @classmethod
    @abstractmethod
    def faults(cls, folder: Path) -> Iterator[str]:
        """Yields a sentence for each fault of a data set."""

    @classmethod
    @abstractmethod
    def summary(cls, folder: Path) -> str:
        """Returns format and size of a data set without faults, such as `LeRobot v3.0: 2 episodes, 128 frames`."""
