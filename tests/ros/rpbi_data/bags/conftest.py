"""Bags of a test, written with rosbag."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import genpy
import pytest
import rosbag

WriteBag = Callable[..., Path]
NANOSECONDS_PER_MESSAGE = 1_000_000


@pytest.fixture
def write_bag(tmp_path: Path) -> WriteBag:
    """Writes (topic, message) pairs, 1 ms apart from 100 s on, and returns the path of the bag."""

    def write(messages: Iterable[tuple[str, Any]], name: str = "test.bag", compression: str = "none") -> Path:
        path = tmp_path / name
        with rosbag.Bag(str(path), "w", compression=compression, chunk_threshold=10_000) as bag:
            for index, (topic, message) in enumerate(messages):
                bag.write(topic, message, genpy.Time(100, index * NANOSECONDS_PER_MESSAGE))
        return path

    return write
