"""Data set format that consists of rosbag2 recordings in MCAP files, with all recorded messages."""

from __future__ import annotations

import hashlib
import io
import shutil
from collections.abc import Iterator
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any, ClassVar, Literal

from pydantic import Field

from custom_ros_tools.errors import MissingDependency
from custom_ros_tools.schema import ConfigModel
from rpbi_data.datasets.checks import Facts, guarded
from rpbi_data.datasets.format import DatasetError, DatasetFormat, ExportedEpisode, Schema

try:
    from rosbags.convert import ConverterError, convert
    from rosbags.rosbag2 import Reader, ReaderError
    from rosbags.typesys import Stores, get_typestore
except ImportError:
    raise MissingDependency("rosbags", "./rpbi setup data") from None

ROSBAG2_VERSION = 9
"""Version of a recording's metadata, as in ROS 2 Jazzy."""


class McapConfig(ConfigModel):
    """Options of the format `mcap`."""

    distribution: Literal["humble", "jazzy", "kilted"] = Field(
        "jazzy", description="ROS 2 distribution whose message definitions are used."
    )


class Mcap(DatasetFormat):
    """Format `mcap`: for each episode, a rosbag2 recording in an MCAP file, with all topics."""

    Config = McapConfig
    has_rows: ClassVar[bool] = False
    content = "folders with metadata.yaml (rosbag2)"

    def open(self, folder: Path, schema: Schema | None) -> None:
        """Prepares the conversion of message types."""
        self._folder = folder
        self._types = get_typestore(Stores[f"ROS2_{self.config.distribution.upper()}"])

    def add(self, index: int, episode: ExportedEpisode) -> dict[str, Any]:
        """Converts the bag of an episode to a rosbag2 recording."""
        target = self._folder / f"episode_{index:06d}"
        try:
            _convert(episode.bag, target, self._types)
            topics = _topics_of(target)
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
        """Does nothing, since a recording is complete after `add`."""

    @classmethod
    def recognises(cls, folder: Path) -> bool:
        """Returns True if at least one subfolder of a folder contains a `metadata.yaml` or an MCAP file."""
        return bool([*folder.glob("*/metadata.yaml"), *folder.glob("*/*.mcap")])

    @classmethod
    def faults(cls, folder: Path) -> Iterator[str]:
        """Yields a message for each fault."""
        return _faults(folder)

    @classmethod
    def summary(cls, folder: Path) -> str:
        """Returns a text with the numbers of episodes and messages."""
        found = [_count(each.parent) for each in sorted(folder.glob("*/metadata.yaml"))]
        return f"rosbag2 in MCAP: {len(found)} episodes, {sum(found)} messages"


def _convert(bag: Path, target: Path, types: Any) -> None:
    """Converts all topics of a ROS 1 bag to a rosbag2 recording, with the message definitions in the bag."""
    choices = ("exclude_topics", "include_topics", "exclude_msgtypes", "include_msgtypes")
    everything: dict[str, Any] = dict.fromkeys(choices, ())
    plain: dict[str, Any] = {"compress": None, "compress_mode": "message"}
    with redirect_stdout(io.StringIO()):  # `convert` prints types unknown to ROS 2, but writes them
        convert([bag], target, "mcap", ROSBAG2_VERSION, default_typestore=None, typestore=types, **plain, **everything)


def _count(recording: Path) -> int:
    with Reader(recording) as reader:
        return int(reader.message_count)


def _topics_of(recording: Path) -> dict[str, dict[str, Any]]:
    """Returns message type, number of messages, and SHA-256 of stamps and content, indexed by topic.

    Raises:
        ReaderError: If the recording cannot be read.
    """
    found: dict[str, dict[str, Any]] = {}
    digests: dict[str, Any] = {}
    with Reader(recording) as reader:
        for connection, stamp_ns, data in reader.messages():
            each = found.setdefault(connection.topic, {"type": connection.msgtype, "messages": 0})
            each["messages"] += 1
            digest = digests.setdefault(connection.topic, hashlib.sha256())
            digest.update(stamp_ns.to_bytes(8, "little", signed=True) + bytes(data))
    return {topic: {**each, "sha256": digests[topic].hexdigest()} for topic, each in sorted(found.items())}


def _faults(folder: Path) -> Iterator[str]:
    """Yields a message for each fault of a folder of recordings."""
    facts = Facts(folder)
    yield from guarded("rpbi", _recording_faults(folder, facts))
    yield from facts.faults


def _recording_faults(folder: Path, facts: Facts) -> Iterator[str]:
    names = sorted(each.name for each in folder.iterdir() if each.is_dir() and each.name != "rpbi")
    for index, name in enumerate(names):
        stored = facts.episode(index)
        yield from facts.chain_faults(index, stored)
        try:
            found = _topics_of(folder / name)
        except (ReaderError, OSError, ValueError, KeyError, AssertionError) as error:
            yield f"{name}: cannot be read: {' '.join(str(error).split()) or type(error).__name__}"
            continue
        except Exception as error:  # a damaged file makes its reader fail in many ways
            yield f"{name}: is damaged: {type(error).__name__}: {' '.join(str(error).split())}"
            continue
        expected = stored.get("topics", {})
        for topic in sorted(expected.keys() | found.keys() if expected else ()):
            ours, theirs = expected.get(topic), found.get(topic)
            if ours is None or theirs is None:
                yield f"{name}: {topic}: {'was not exported' if ours is None else 'was exported and is missing'}"
            elif ours["messages"] != theirs["messages"]:
                yield f"{name}: {topic}: {ours['messages']} messages were exported, found {theirs['messages']}"
            elif ours != theirs:
                yield f"{name}: {topic}: stamps or contents were changed after the export"
    yield from facts.total_faults(len(names))
