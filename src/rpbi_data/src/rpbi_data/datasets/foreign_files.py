"""Reads untrusted Parquet, HDF5 and JSON files within limits, and forms file names from untrusted templates."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from custom_ros_tools.errors import ConfigError
from custom_ros_tools.foreign import load_foreign_json, path_below, read_below

MAX_JSON_BYTES = 256_000_000
"""Largest size of a JSON file [bytes]; state hashes of hours can be this large."""
MAX_JSON_VALUES = 20_000_000
MAX_VALUES = 20_000_000
"""Number of values that a Parquet or HDF5 file may always have. A larger file may have one value for each byte."""
MAX_ROW_BYTES = 100_000_000
"""Largest size of one image in an HDF5 file [bytes]."""
MAX_UNFOLDED_BYTES = 2**30
"""Total unpacked size that the images of an HDF5 file may always have [bytes].

In a large file, images may unpack to `MAX_COMPRESSION` times the size of the file.
"""
MAX_COMPRESSION = 1032
"""Largest compression ratio of images in an HDF5 file; gzip cannot exceed this ratio."""
MAX_OBJECTS = 100_000
"""Largest number of groups and data sets in an HDF5 file."""
MAX_PLACE = 1_000_000_000
"""Largest number that may replace a placeholder in a file name."""
_PLACEHOLDER = re.compile(r"\{(\w+)(?::0?(\d)d)?\}")


def read_json(folder: Path, name: str) -> Any:
    """Returns the content of a JSON file of a data set.

    Raises:
        ValueError: If the file cannot be read, or is too large.
    """
    try:
        return load_foreign_json(read_below(folder, name, MAX_JSON_BYTES), name, MAX_JSON_BYTES, MAX_JSON_VALUES)
    except ConfigError as error:
        raise ValueError("; ".join(each.message for each in error.problems)) from None


def file_name(template: Any, place: Mapping[str, Any]) -> str:
    """Returns the file name that results from a template such as `data/file-{file_index:03d}.parquet`.

    Args:
        template: The template. Only the placeholders `{name}` and `{name:03d}`, with any width, are allowed.
        place: Values of the placeholders, indexed by name: texts, or integers from 0 to `MAX_PLACE`.

    Raises:
        ValueError: If the template has an unknown placeholder, a value is not allowed, or the file would be outside of
            the data set.
    """
    for key, value in place.items():
        is_number = isinstance(value, int) and 0 <= value <= MAX_PLACE
        if not is_number and not isinstance(value, str):
            raise ValueError(f"{key}: expected a number from 0 on, found {value!r:.60}")

    def filled(match: re.Match[str]) -> str:
        key, width = match.groups()
        if key not in place:
            raise ValueError(f"expected the placeholders {', '.join(place)}, found '{key}'")
        return str(place[key]).zfill(int(width or 0))

    if not isinstance(template, str) or re.search("[{}]", _PLACEHOLDER.sub("", template)):
        raise ValueError(f"expected a name with placeholders such as {{file_index:03d}}, found {template!r:.100}")
    name = _PLACEHOLDER.sub(filled, template)
    try:
        path_below(Path("/"), name)
    except ConfigError as error:
        raise ValueError("; ".join(each.message for each in error.problems)) from None
    return "/".join(part for part in name.split("/") if part not in ("", "."))


def read_parquet(path: Path) -> Any:
    """Checks the number of values in a Parquet file's metadata, and returns the table in the file.

    Raises:
        ValueError: If the file cannot be read, or has too many values.
    """
    import pyarrow as pa
    from pyarrow import parquet

    try:
        with parquet.ParquetFile(path, memory_map=False, pre_buffer=False) as file:
            facts = file.metadata
            groups = [facts.row_group(number) for number in range(facts.num_row_groups)]
            values = sum(group.column(i).num_values for group in groups for i in range(facts.num_columns))
            most = max(MAX_VALUES, path.stat().st_size)
            if max(values, facts.num_rows) > most:
                raise ValueError(f"expected at most {most:,} values, found {max(values, facts.num_rows):,}")
            return file.read(use_threads=False)
    except (OSError, pa.ArrowException) as error:
        raise ValueError(f"cannot be read: {getattr(error, 'strerror', None) or _words(error)}") from error


def hdf5_faults(file: Any, size: int) -> Iterator[str]:
    """Yields a message for each object of an HDF5 file that must not be read.

    Such objects are soft and external links, objects with two names, data in other files, data that are neither
    numbers nor texts, and data that unpack to too many values or bytes.

    Args:
        file: The open file.
        size: Size of the file [bytes].
    """
    import h5py

    waiting = [(file, "")]
    objects = values = unfolded = 0
    most_bytes = max(MAX_UNFOLDED_BYTES, MAX_COMPRESSION * size)
    known: set[int] = set()
    most = max(MAX_VALUES, size)
    while waiting:
        group, path = waiting.pop()
        for name in group:
            objects += 1
            if objects > MAX_OBJECTS:
                yield f"expected at most {MAX_OBJECTS:,} groups and data sets, found more"
                return
            place = f"{path}/{name}".lstrip("/")
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                yield f"{place}: expected no link, found {type(group.get(name, getlink=True)).__name__}"
                continue
            each = group[name]
            address = h5py.h5o.get_info(each.id).addr
            if address in known or each == file:
                yield f"{place}: expected a group or data set of its own, found one that has another name, too"
                continue
            known.add(address)
            if isinstance(each, h5py.Group):
                waiting.append((each, place))
                continue
            if not isinstance(each, h5py.Dataset):
                yield f"{place}: expected a group or numbers, found a type"
                continue
            if each.is_virtual or each.external:
                yield f"{place}: expected values in this file, found some in others"
            elif each.dtype.kind not in "iufbS" and h5py.check_string_dtype(each.dtype) is None:
                yield f"{place}: expected numbers or texts, found {str(each.dtype):.60}"
            elif each.ndim > 2 and each.size * each.dtype.itemsize > MAX_ROW_BYTES * max(1, each.shape[0]):
                yield f"{place}: expected images of at most {MAX_ROW_BYTES:,} bytes, found larger ones"
            elif each.ndim > 2:
                unfolded += each.size * each.dtype.itemsize
                if unfolded > most_bytes:
                    yield f"{place}: expected at most {most_bytes:,} bytes of images in all, found more"
                    return
            else:
                values += each.size * max(1, each.dtype.itemsize // 8)
                if values > most:
                    yield f"{place}: expected at most {most:,} values in all, found more"
                    return


def _words(error: Exception) -> str:
    return " ".join(str(error).split())
