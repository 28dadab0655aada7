"""Columns of tables: values read out of messages, and the pieces that make up a column."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .layout import BYTES, NUMBER_DTYPES, Leaf

Array = NDArray[Any]


def read_leaf(leaf: Leaf, matrix: Array) -> Array:
    """Reads the same value out of several messages.

    Args:
        leaf: Where it lies.
        matrix: Messages of one layout, shape (n, size), uint8.

    Returns:
        Shape (n,): numbers of the field's own type, bool, float64 [s] for `time` and `duration`, `str` or
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


def _text(cell: Array) -> str:
    return cell.tobytes().decode("utf-8", "replace")


class Pieces:
    """A column in the making: runs of values, each from some row on."""

    def __init__(self) -> None:
        self._pieces: list[tuple[int, Array]] = []

    def append(self, start: int, values: Array) -> None:
        """Adds the values of the rows from `start` on."""
        self._pieces.append((start, values))

    def join(self, rows: int) -> Array:
        """Returns the column, shape (rows,); where no value was added it is NaN, or None in text and bool."""
        dtypes = {values.dtype for _, values in self._pieces}
        is_mixed = len({"number" if dtype.kind in "iuf" else dtype.kind for dtype in dtypes}) > 1
        dtype = np.dtype(object) if is_mixed else np.result_type(*dtypes)
        if sum(len(values) for _, values in self._pieces) < rows:
            if dtype.kind in "iu":
                dtype = np.dtype(float)
            elif dtype.kind == "b":
                dtype = np.dtype(object)
        column: Array = np.full(rows, None if dtype.kind == "O" else np.nan if dtype.kind == "f" else 0, dtype)
        for start, values in self._pieces:
            column[start : start + len(values)] = values
        return column
