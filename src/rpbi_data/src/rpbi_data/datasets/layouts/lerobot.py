"""Files and columns of LeRobot data sets of version 3.0."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

VERSION = "v3.0"
CHUNK = 1000
"""Number of files in a folder."""
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
EPISODES_PATH = "meta/episodes/chunk-000/file-000.parquet"
ROW_COLUMNS = {
    "timestamp": "float32",
    "frame_index": "int64",
    "episode_index": "int64",
    "index": "int64",
    "task_index": "int64",
}
"""Columns of every data set, and their types."""


def place(number: int) -> dict[str, int]:
    """Returns the folder of a file and its number in it."""
    return {"chunk_index": number // CHUNK, "file_index": number % CHUNK}


def data_file(number: int) -> Path:
    """Returns the path of a data file in the data set."""
    return Path(DATA_PATH.format(**place(number)))


def video_file(key: str, number: int) -> Path:
    """Returns the path of a video file in the data set."""
    return Path(VIDEO_PATH.format(video_key=key, **place(number)))


def matrix(column: Any) -> Array:
    """Returns a column of a Parquet table with a row for each of its rows; one number a row is one column.

    Raises:
        ValueError: If its rows differ in length, or are no numbers.
    """
    array = column.combine_chunks()
    if array.null_count:
        raise ValueError(f"{array.null_count} rows have no value")
    rows = len(array)
    while hasattr(array.type, "value_type"):
        array = array.flatten()
    flat = np.asarray(array)
    if rows and len(flat) % rows:
        raise ValueError("rows differ in length")
    flat = flat.reshape(rows, -1) if rows else flat.reshape(0, 1)
    if flat.dtype.kind not in "iufb":
        raise ValueError(f"expected numbers, got {array.type}")
    return flat
