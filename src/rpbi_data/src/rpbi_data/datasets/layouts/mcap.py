"""Content of rosbag2 recordings."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from custom_ros_tools.errors import MissingDependency

try:
    from rosbags.rosbag2 import Reader
except ImportError:
    raise MissingDependency("rosbags", "./rpbi setup data") from None


def topics_of(recording: Path) -> dict[str, dict[str, Any]]:
    """Returns type, number of messages and SHA-256 of stamps and content of each topic of a recording.

    Raises:
        ReaderError: If it cannot be read.
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
