"""Tables to files."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd

from custom_ros_tools.errors import MissingDependency

FORMATS = ("parquet", "csv")


def file_stems(topics: Iterable[str]) -> dict[str, str]:
    """Finds a file name for each topic: `/kuka/joint_states` becomes `kuka.joint_states`.

    Names are made of letters, digits, `_`, `-` and `.`; where two would be the same, the second ends with
    `-2`.
    """
    stems: dict[str, str] = {}
    for topic in topics:
        stem = re.sub(r"[^\w.-]", "_", topic.strip("/").replace("/", "."), flags=re.ASCII).strip(".") or "_"
        number, unique = 1, stem
        while unique in stems.values():
            number += 1
            unique = f"{stem}-{number}"
        stems[topic] = unique
    return stems


def write_table(table: pd.DataFrame, path: Path) -> None:
    """Writes a table with its index; the ending of the file, `.parquet` or `.csv`, says how.

    A column of several types (two types of message on one topic) becomes text in a Parquet file.

    Raises:
        ValueError: If binary columns were to go into a text file.
        MissingDependency: If fastparquet is not installed.
        OSError: If the file cannot be written.
    """
    if path.suffix == ".csv":
        binary = [name for name in table.columns if _encoding(table[name]) == "bytes"]
        if binary:
            raise ValueError(f"'{binary[0]}' is binary and cannot be written as CSV: use Parquet")
        table.to_csv(path)
        return
    try:
        import fastparquet  # noqa: F401  (slow to load, and not needed for CSV)
    except ImportError as error:
        raise MissingDependency("fastparquet", "pip install fastparquet, or write CSV") from error
    encodings = {name: encoding for name in table.columns if (encoding := _encoding(table[name]))}
    texts = {name: table[name].map(str, na_action="ignore") for name in encodings if encodings[name] == "utf8"}
    table.assign(**texts).to_parquet(path, engine="fastparquet", object_encoding=encodings or "infer")


def _encoding(column: pd.Series) -> str | None:
    """Returns how Parquet is to hold a column of Python objects, or None for a column of numbers."""
    if column.dtype != np.dtype(object):
        return None
    kinds = {type(value) for value in column if value is not None}
    if kinds == {bool}:
        return "bool"
    return "bytes" if kinds == {bytes} else "utf8"
