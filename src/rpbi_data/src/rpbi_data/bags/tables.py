"""Converts serialised messages to pandas tables, many at a time and without ROS, and writes tables to files."""

import logging
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from custom_ros_tools.errors import MissingDependency
from custom_ros_tools.files import atomic_file

from .limits import MAX_COLUMNS, Budget, LimitError
from .message_layout import BYTES, NUMBER_DTYPES, Leaf, MessageType
from .row_plan import INDEX, RECORD_TIME, STAMP, Columns, plan_rows
from .times import PER_SECOND, clock_of, to_seconds

Array = NDArray[Any]
_Piece = tuple[int, Array]
"""Index of the first row, and values of a column from this row on."""

FORMATS = ("parquet", "csv", "hdf5")
BATCH_MESSAGES = 16_384
BATCH_BYTES = 32 * 1024 * 1024
MAX_STEM_LENGTH = 200
"""Largest number of characters of a file name, without number and suffix; file systems allow 255 bytes."""
MAX_PIECES = 500_000
"""Number of pieces of all columns above which pieces are merged; each needs 200 bytes in addition to its values."""
OWN_COLUMNS = 3
"""Number of columns that the builder adds: time, recording time, and number of the message."""

_log = logging.getLogger(__name__)


class _Block(NamedTuple):
    """Messages with the same layout.

    Attributes:
        rows: Rows into which a message is converted, see `RowPlan.rows`.
        matrix: The n serialised messages, shape (n, size), uint8.
        indices: Indices of these messages in the batch, ascending, shape (n,).
    """

    rows: list[Columns]
    matrix: Array
    indices: Array


class TableBuilder:
    """Collects the serialised messages of one topic, and converts them to one table.

    Messages are read in batches. All messages of a batch with the same layout, see `message_layout.py`, are read at
    once. Strings and numbers are not changed. A value that a message lacks is NaN, or None in columns of text.

    Args:
        topic: Name of the topic, for the log.
        keep_binary: Whether binary arrays become columns of `bytes`; otherwise they are left out.
        budget: Limits of time and cells; None for no limits.
        is_plain: Whether every message becomes one row, and the name of a column is the path of the field.
        in_nanoseconds: Whether the index is int64 [ns] instead of float [s].
    """

    def __init__(
        self,
        topic: str,
        keep_binary: bool = False,
        budget: Budget | None = None,
        is_plain: bool = False,
        in_nanoseconds: bool = False,
    ) -> None:
        self._topic = topic
        self._in_nanoseconds = in_nanoseconds
        self._is_plain = is_plain
        self._budget = budget
        self._keep_binary = keep_binary
        self._batch: list[tuple[MessageType, bytes, int]] = []
        self._batch_bytes = 0
        self._messages = 0
        self._rows = 0
        self._time: list[Array] = []
        self._record_time: list[Array] = []
        self._message: list[Array] = []
        self._columns: dict[str, list[_Piece]] = {}
        self._pieces = self._merged_rows = 0
        self._appeared: dict[str, tuple[int, int]] = {}
        self._notes: Counter[str] = Counter()
        self._types: Counter[str] = Counter()

    def add(self, message_type: MessageType, raw: bytes, record_time_ns: int) -> None:
        """Adds a serialised message and its recording time [ns].

        Raises:
            LimitError: If the table has too many columns, or a column's name is too long.
            BagError: If the budget is used up.
        """
        self._batch.append((message_type, raw, record_time_ns))
        self._batch_bytes += len(raw)
        if len(self._batch) >= BATCH_MESSAGES or self._batch_bytes >= BATCH_BYTES:
            self._read_batch()

    def table(self) -> pd.DataFrame:
        """Returns the table of all messages, sorted by time. Must be called only once, after the last message.

        The index `time` is the stamp of the header [s], or int64 [ns] with `in_nanoseconds`. If a message has no
        header or the stamp 0, `time` is the recording time. The first column is `record_time` [s]. Other columns are
        grouped by field. A warning is logged if a clock was set back, or if messages have several types.

        Raises:
            LimitError, BagError: See `add`.
        """
        self._read_batch()
        for note, times in self._notes.items():
            _log.warning("%s: %s (messages: %d)", self._topic, note, times)
        if len(self._types) > 1:
            came = ", ".join(f"{name} (messages: {count})" for name, count in sorted(self._types.items()))
            _log.warning("%s: expected messages of one type, got %s", self._topic, came)
        time = np.concatenate([*self._time, np.empty(0, np.int64)])
        record_time = to_seconds(np.concatenate([*self._record_time, np.empty(0, np.int64)]))
        order = np.lexsort((np.concatenate([*self._message, np.empty(0, int)]), time))  # stable
        names = sorted(self._columns, key=self._appeared.__getitem__)
        fields = dict.fromkeys(name.split("/")[0] for name in names)
        places = {field: place for place, field in enumerate(fields)}
        names.sort(key=lambda name: places[name.split("/")[0]])  # stable
        columns = {name: _join(self._columns.pop(name), self._rows)[order] for name in names}
        index = pd.Index(to_seconds(time[order]), name=INDEX)
        table = pd.DataFrame({RECORD_TIME: record_time[order], **columns}, index)
        if (clock := clock_of(table)).is_fault:
            _log.warning("%s: %s", self._topic, clock)
        return table.set_axis(pd.Index(time[order], name=INDEX)) if self._in_nanoseconds else table

    def _read_batch(self) -> None:
        """Reads the messages of the current batch, grouped by type and size."""
        groups: dict[tuple[MessageType, int], list[int]] = {}
        for index, (message_type, raw, _) in enumerate(self._batch):
            groups.setdefault((message_type, len(raw)), []).append(index)
        for (message_type, size), indices in groups.items():
            self._types[message_type.name] += len(indices)
            joined = b"".join(self._batch[index][1] for index in indices)
            matrix = np.frombuffer(joined, np.uint8).reshape(len(indices), size)
            for block in self._split_by_layout(message_type, matrix, np.array(indices)):
                self._read_block(block)
        self._merge_pieces()
        self._messages += len(self._batch)
        self._batch, self._batch_bytes = [], 0

    def _read_block(self, block: _Block) -> None:
        """Reads all rows of messages with the same layout.

        Raises:
            LimitError: If the table has too many columns.
            BagError: If all tables together have too many cells.
        """
        first, places = self._messages + int(block.indices[0]), count()
        for row in block.rows:
            for name in row:
                place = first, next(places)
                self._appeared[name] = min(self._appeared.get(name, place), place)
            self._read_rows(row, block.matrix, block.indices)
        if len(self._columns) > MAX_COLUMNS:
            raise LimitError.over(f"{MAX_COLUMNS:,} columns", f"{len(self._columns):,}")
        if self._budget is not None:
            self._budget.set_cells(self._topic, self._rows, len(self._columns) + OWN_COLUMNS)
        self._pieces += sum(map(len, block.rows))
        if self._pieces > MAX_PIECES:
            self._merge_pieces()

    def _merge_pieces(self) -> None:
        """Merges the pieces of each column that were added since the last merge, to save memory."""
        first, rows = self._merged_rows, self._rows - self._merged_rows
        for pieces in self._columns.values():
            new = [(start - first, values) for start, values in pieces if start >= first]
            if len(new) > 1:
                pieces[-len(new) :] = [(first, _join(new, rows))]
        self._merged_rows, self._pieces = self._rows, 0

    def _split_by_layout(self, message_type: MessageType, matrix: Array, indices: Array) -> Iterator[_Block]:
        """Splits messages of one type and size into blocks with the same layout; for the arguments, see `_Block`."""
        while len(indices):
            if self._budget is not None:
                self._budget.check_time(self._topic)
            try:
                plan = plan_rows(message_type, self._batch[indices[0]][1], self._is_plain)
            except LimitError:
                raise
            except ValueError as error:
                _log.debug("%s: message %d: %s", self._topic, self._messages + indices[0], error)
                self._notes["a message does not fit its type: left out"] += 1
                matrix, indices = matrix[1:], indices[1:]
                continue
            same = np.ones(len(indices), bool)
            for start, stop in plan.fixed:
                same &= (matrix[:, start:stop] == matrix[0, start:stop]).all(axis=1)
                if np.count_nonzero(same) == 1:
                    break
            alike = int(np.count_nonzero(same))
            for note in plan.notes:
                self._notes[note] += alike
            if alike == len(indices):
                yield _Block(plan.rows, matrix, indices)
                return
            if alike == 1:  # a view, without a copy
                yield _Block(plan.rows, matrix[:1], indices[:1])
                matrix, indices = matrix[1:], indices[1:]
                continue
            yield _Block(plan.rows, matrix[same], indices[same])
            matrix, indices = matrix[~same], indices[~same]

    def _read_rows(self, row: Columns, matrix: Array, indices: Array) -> None:
        """Reads one row of each message; for `matrix` and `indices`, see `_Block`."""
        record_time = np.array([self._batch[index][2] for index in indices], np.int64)
        time = record_time
        for name, leaf in row.items():
            if leaf.kind == BYTES and not self._keep_binary:
                self._notes[f"'{name}' is binary or long: left out, unless asked for"] += len(indices)
                continue
            if name == STAMP and leaf.kind == "time":
                stamps = _read_stamps(leaf, matrix)
                time = np.where(stamps == 0, record_time, stamps)  # 0 is ROS for "no time"
            else:
                self._columns.setdefault(name, []).append((self._rows, _read_leaf(leaf, matrix)))
        self._time.append(time)
        self._record_time.append(record_time)
        self._message.append(self._messages + indices)
        self._rows += len(indices)


def _read_leaf(leaf: Leaf, matrix: Array) -> Array:
    """Reads the value at one location from each of n messages with the same layout, shape (n, size), uint8.

    Returns:
        Values of the shape (n,): numbers of the field's type, bool, float64 [s] for `time` and `duration`, `str`, or
        `bytes`.
    """
    start, stop = leaf.span
    cells = np.ascontiguousarray(matrix[:, start:stop])
    if leaf.kind in NUMBER_DTYPES:
        numbers: Array = cells.view(NUMBER_DTYPES[leaf.kind])[:, 0]
        return numbers.astype(bool) if leaf.kind == "bool" else numbers
    if leaf.kind in ("time", "duration"):
        seconds, nanoseconds = cells.view("<u4" if leaf.kind == "time" else "<i4").T
        times: Array = seconds + nanoseconds / 1e9  # as `to_sec()` does it
        return times
    values: Array = np.empty(len(cells), object)
    if leaf.kind == BYTES:
        values[:] = [cell.tobytes() for cell in cells]
    elif (cells == cells[0]).all():
        values[:] = _text(cells[0])
    else:
        known: dict[bytes, str] = {}  # equal texts share their memory
        values[:] = [known.setdefault(cell.tobytes(), _text(cell)) for cell in cells]
    return values


def _read_stamps(leaf: Leaf, matrix: Array) -> Array:
    """Reads the `time` at one location from each of n messages with the same layout; returns int64, shape (n,) [ns]."""
    start, stop = leaf.span
    seconds, nanoseconds = np.ascontiguousarray(matrix[:, start:stop]).view("<u4").astype(np.int64).T
    return np.asarray(seconds * PER_SECOND + nanoseconds)


def _text(cell: Array) -> str:
    return cell.tobytes().decode("utf-8", "replace")


def _join(pieces: list[_Piece], rows: int) -> Array:
    """Joins the pieces of a column, shape (rows,). Missing values are NaN, or None in columns of text and bool."""
    dtypes = {values.dtype for _, values in pieces}
    is_mixed = len({"number" if dtype.kind in "iuf" else dtype.kind for dtype in dtypes}) > 1
    dtype = np.dtype(object) if is_mixed else np.result_type(*dtypes)
    if sum(len(values) for _, values in pieces) < rows:
        dtype = {"i": np.dtype(float), "u": np.dtype(float), "b": np.dtype(object)}.get(dtype.kind, dtype)
    column: Array = np.full(rows, None if dtype.kind == "O" else np.nan if dtype.kind == "f" else 0, dtype)
    for start, values in pieces:
        column[start : start + len(values)] = values
    return column


def file_stems(topics: Iterable[str]) -> dict[str, str]:
    """Returns a file name without suffix for each topic: `/kuka/joint_states` becomes `kuka.joint_states`.

    Names consist of at most `MAX_STEM_LENGTH` letters, digits, `_`, `-` and `.`. If two names would be equal, the
    second one ends with `-2`.
    """
    stems: dict[str, str] = {}
    used: Counter[str] = Counter()
    for topic in topics:
        stem = (
            re.sub(r"[^\w.-]", "_", topic.strip("/").replace("/", "."), flags=re.ASCII).strip(".")[:MAX_STEM_LENGTH]
            or "_"
        )
        unique = stem
        while unique in used:
            used[stem] += 1
            unique = f"{stem}-{used[stem]}"
        used[unique] += 1
        stems[topic] = unique
    return stems


def write_table(table: pd.DataFrame, path: Path) -> None:
    """Writes a table with its index to a file; the suffix `.parquet`, `.csv` or `.hdf5` determines the format.

    If a topic has two message types, a column may have values of several types. Parquet and HDF5 files contain such
    values as text. An HDF5 file has a data set for each column, in groups separated by `/`, and the index as `time`.

    Raises:
        ValueError: If a column is binary and the format is CSV, or HDF5 cannot represent a column.
        MissingDependency: If fastparquet or h5py is not installed.
        OSError: If the file cannot be written; an existing file is not changed then.
    """
    with atomic_file(path) as part:
        _WRITERS[path.suffix](table, part)


def _write_csv(table: pd.DataFrame, path: Path) -> None:
    binary = [name for name in table.columns if _encoding(table[name]) == "bytes"]
    if binary:
        raise ValueError(f"'{binary[0]}' is binary and cannot be written as CSV: use Parquet")
    table.to_csv(path)


def _write_parquet(table: pd.DataFrame, path: Path) -> None:
    try:
        import fastparquet  # noqa: F401  (slow to load, and not needed for CSV)
    except ImportError as error:
        raise MissingDependency("fastparquet", "pip install fastparquet, or write CSV") from error
    encodings = {name: encoding for name in table.columns if (encoding := _encoding(table[name]))}
    texts = {name: table[name].map(str, na_action="ignore") for name in encodings if encodings[name] == "utf8"}
    table.assign(**texts).to_parquet(path, engine="fastparquet", object_encoding=encodings or "infer")


def _write_hdf5(table: pd.DataFrame, path: Path) -> None:
    try:
        import h5py
    except ImportError as error:
        raise MissingDependency("h5py", "apt install python3-h5py, or write Parquet") from error
    kinds = {"utf8": h5py.string_dtype(), "bytes": h5py.special_dtype(vlen=np.uint8)}
    with h5py.File(path, "w") as file:
        for name, column in table.reset_index().items():
            encoding = _encoding(column)
            values = column.to_numpy()
            if encoding == "utf8":
                values = np.array(["" if value is None else str(value) for value in values], object)
            elif encoding == "bytes":
                values = _rows_of([np.frombuffer(value or b"", np.uint8) for value in values])
            elif encoding == "bool":
                values = np.array([np.nan if value is None else value for value in values], float)
            try:
                file.create_dataset(str(name), data=values, dtype=kinds.get(str(encoding)))
            except (ValueError, TypeError) as error:
                raise ValueError(f"'{name}' cannot be a data set of an HDF5 file: {error}; use Parquet") from error


_WRITERS = {".parquet": _write_parquet, ".csv": _write_csv, ".hdf5": _write_hdf5}


def _rows_of(cells: list[Array]) -> Array:
    """Converts a list of arrays with different lengths to an array of n objects, shape (n,)."""
    rows: Array = np.empty(len(cells), object)
    rows[:] = cells
    return rows


def _encoding(column: pd.Series) -> str | None:
    """Returns the Parquet encoding of a column of Python objects, or None for a column of numbers."""
    if column.dtype != np.dtype(object):
        return None
    kinds = {type(value) for value in column if value is not None}
    if kinds == {bool}:
        return "bool"
    return "bytes" if kinds == {bytes} else "utf8"
