"""Base class of data set formats, and the classes of the data that a format writes."""

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
"""Keys of two features of every row: its time in the recording's clock, and the time error of each feature [s]."""
STAMP_NAMES = ("sec", "nsec")
"""Columns of a stamp, int64: LeRobot's reader would return a floating-point stamp in single precision."""
QUATERNION = ("qx", "qy", "qz", "qw")
"""Names of the four components of a quaternion, in the order of a feature's columns."""


@dataclass(eq=False)
class DatasetError(EpisodeError):
    """A data set cannot be written or read."""


def stamps_of(times: Array) -> Array:
    """Splits times [ns], shape (n,), into seconds and nanoseconds, and returns both, shape (n, 2), int64."""
    return np.stack(np.divmod(times, PER_SECOND), axis=1)


class Feature(NamedTuple):
    """A feature that consists of numbers in each row.

    Attributes:
        key: Name of the feature in the data set, such as `observation.state`.
        names: Name of each number, such as a joint name.
        dtype: NumPy type of the numbers.
    """

    key: str
    names: tuple[str, ...]
    dtype: str = "float32"


class CameraFeature(NamedTuple):
    """A feature that consists of an RGB image with 8 bits per channel in each row.

    Attributes:
        key: Name of the feature in the data set, such as `observation.images.camera`.
        height: Number of pixel rows, which is even.
        width: Number of pixel columns, which is even.
    """

    key: str
    height: int
    width: int


class Schema(NamedTuple):
    """Content of the rows of all episodes of a data set.

    Attributes:
        fps: Number of rows per second.
        features: Features that consist of numbers.
        cameras: Features that consist of images.
    """

    fps: int
    features: tuple[Feature, ...]
    cameras: tuple[CameraFeature, ...] = ()


class ImageFrame(NamedTuple):
    """The image of a camera in a row of the data set.

    Attributes:
        pixels: Red, green and blue, shape (height, width, 3), uint8.
        stamp: Time of the image in the clock of the recording [ns].
    """

    pixels: Array
    stamp: int


class ExportedEpisode(ABC):
    """An episode with n rows, which a format writes into a data set.

    Attributes:
        bag: Path of the recorded bag.
        task: Description of the task in words.
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
        """Yields, for each of the n rows, the newest image of a camera at the time of the row.

        Args:
            key: Key of the camera.

        Raises:
            InterfaceError: If an image cannot be read.
        """

    @abstractmethod
    def values(self, image_stamps: Mapping[str, Array]) -> dict[str, Array]:
        """Returns the values of all numeric features, indexed by key, each of shape (n, number of names).

        Args:
            image_stamps: Times of the images in the rows, indexed by camera key, int64, shape (n,) [ns].
        """


def require_room(folder: Path, size: int) -> None:
    """Raises an OSError if the disk of a folder has less free space than `size` [bytes].

    To check the space, a temporary file of this size is created and removed.
    """
    with tempfile.TemporaryFile(dir=folder) as file:
        os.posix_fallocate(file.fileno(), 0, size)


class DatasetFormat(ABC):
    """Base class of data set formats. A format writes data sets, recognises data sets of its kind, and checks them.

    The export calls `open`, then `add` for each episode, then `close`. Added episodes stay complete if a later `add`
    fails. If `close` fails because the disk is full, the export calls `take_back` and `close` again.

    Args:
        config: Options of the format, an instance of `Config`.
    """

    Config: ClassVar[type[ConfigModel]] = ConfigModel
    has_rows: ClassVar[bool] = True
    """Whether the format writes rows at a constant rate. If False, the format converts bags, and the schema is None."""
    content: ClassVar[str] = "files of another format"
    """Description of the files that identify the format, for the error message about a folder of unknown format."""

    def __init__(self, config: Any) -> None:
        self.config = config

    @abstractmethod
    def open(self, folder: Path, schema: Schema | None) -> None:
        """Starts a data set in an empty folder.

        Args:
            folder: The empty folder.
            schema: Content of the rows; None for a format without rows.
        """

    @abstractmethod
    def add(self, index: int, episode: ExportedEpisode) -> dict[str, Any]:
        """Writes an episode. After an error, no part of the episode is left in the folder.

        Args:
            index: Index of the episode in the data set, from 0 without gaps.
            episode: The episode.

        Returns:
            Metadata to store in the folder `rpbi/`, see `rpbi_data.datasets.provenance`.

        Raises:
            InterfaceError: If the episode cannot be read.
            OSError: If the episode cannot be written.
        """

    def take_back(self, index: int) -> None:
        """Removes the episode that was added last, which has the given index.

        Called at most once after each `add`, possibly after `close` has failed.

        Raises:
            OSError: If the format cannot remove episodes, as in this base class. The export then fails.
        """
        raise OSError(errno.ENOSPC, f"no room to complete episode {index}")

    @abstractmethod
    def close(self) -> None:
        """Completes the data set.

        Raises:
            OSError: If the remaining files cannot be written.
        """

    @classmethod
    @abstractmethod
    def recognises(cls, folder: Path) -> bool:
        """Returns whether a folder contains a data set of this format, which any tool may have written."""

    @classmethod
    @abstractmethod
    def faults(cls, folder: Path) -> Iterator[str]:
        """Yields a message for each fault of a data set."""

    @classmethod
    @abstractmethod
    def summary(cls, folder: Path) -> str:
        """Returns format and size of a data set without faults, such as `LeRobot v3.0: 2 episodes, 128 frames`."""
