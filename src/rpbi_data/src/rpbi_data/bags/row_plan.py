"""Maps messages to rows and columns of tables: one row per message, except for message types in `PLANS`."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

from custom_ros_tools.errors import shortened

from .limits import MAX_COLUMNS, MAX_NAME_BYTES, LimitError
from .message_layout import MAX_ARRAY_COLUMNS, Layout, Leaf, MessageType, lay_out

STAMP = "header/stamp"
INDEX = "time"
RECORD_TIME = "record_time"
Columns = dict[str, Leaf]
_TRANSFORM = (*(f"translation/{axis}" for axis in "xyz"), *(f"rotation/{axis}" for axis in "xyzw"))


class RowPlan(NamedTuple):
    """Mapping from messages with one layout to table rows.

    Attributes:
        rows: Rows into which a message is converted. Each row is a dictionary with the location of each value in the
            message, indexed by column name. The column `STAMP` is the stamp of the row.
        fixed: Spans of bytes. The plan is valid for all messages with the same bytes in these spans.
        notes: Log messages about content that is not in the table.
    """

    rows: list[Columns]
    fixed: list[tuple[int, int]]
    notes: list[str]


def plan_rows(message_type: MessageType, raw: bytes, is_plain: bool = False) -> RowPlan:
    """Plans rows and columns for a serialised message, and for all messages with the same layout.

    Args:
        message_type: Type of the message.
        raw: The serialised message.
        is_plain: Whether to ignore `PLANS`, and to make one row per message for all message types.

    Raises:
        LimitError: If the message has too many values, a row has too many columns, or a column's name is too long.
        ValueError: If the message does not fit its type.
    """
    layout = lay_out(message_type, raw)
    try:
        rows, names, notes = (_one_row if is_plain else PLANS.get(message_type.name, _one_row))(layout, raw)
    except (KeyError, ValueError):  # the type differs from its usual definition, or a value is in a long array
        rows, names, notes = _one_row(layout, raw)
        notes = [*notes, f"not as {message_type.name} usually is: one row a message"]
    for row in rows:
        _check_columns(row)
    fixed = layout.fixed + [leaf.span for leaf in names]
    return RowPlan([_rename_reserved(row) for row in rows], _merge(fixed), notes)


def _check_columns(row: Columns) -> None:
    """Raises a LimitError if a row has too many columns, or a column's name is too long."""
    if len(row) > MAX_COLUMNS:
        raise LimitError.over(f"{MAX_COLUMNS:,} columns", f"{len(row):,} in one message")
    for name in row:
        if len(name) * 4 > MAX_NAME_BYTES and len(name.encode()) > MAX_NAME_BYTES:
            got = f"{len(name.encode()):,} in '{shortened(name)}'"
            raise LimitError.over(f"{MAX_NAME_BYTES:,} bytes in the name of a column", got)


Plan = tuple[list[Columns], Iterable[Leaf], list[str]]  # rows, leaves that name columns, notes


def _one_row(layout: Layout, raw: bytes) -> Plan:
    """Makes one row with all values, except for long arrays of messages or strings."""
    counts = layout.counts.items()
    long = [path for path, count in counts if count > MAX_ARRAY_COLUMNS and path not in layout.leaves]
    inside = tuple(f"{path}/" for path in long)
    columns = {path: leaf for path, leaf in layout.leaves.items() if not path.startswith(inside)}
    return [columns], [], [f"'{path}' has over {MAX_ARRAY_COLUMNS} elements: left out" for path in long]


def _joint_state(layout: Layout, raw: bytes) -> Plan:
    """Makes one row whose column names contain the joint name, or the joint index if the message has no joint names."""
    leaves, counts, notes = layout.leaves, layout.counts, []
    names = [leaves[f"name/{index}"] for index in range(counts["name"])]
    columns = {path: leaf for path, leaf in leaves.items() if path.startswith("header/")}
    for array in ("position", "velocity", "effort"):
        count = counts[array]
        if names and count not in (0, len(names)):  # values cannot be assigned to joints
            notes.append(f"{count} values of '{array}' for {len(names)} joints: left out")
            continue
        for index in range(count):
            joint = names[index].text(raw) if names else str(index)
            columns[f"{array}/{joint}"] = leaves[f"{array}/{index}"]
    return [columns], names, notes


def _transforms(layout: Layout, raw: bytes) -> Plan:
    """Makes one row per transform, with the stamp of the transform."""
    leaves, rows = layout.leaves, []
    for index in range(layout.counts["transforms"]):
        prefix = f"transforms/{index}/"
        row = {STAMP: leaves[prefix + STAMP]}
        row |= {"parent": leaves[f"{prefix}header/frame_id"], "child": leaves[f"{prefix}child_frame_id"]}
        row |= {value: leaves[f"{prefix}transform/{value}"] for value in _TRANSFORM}
        rows.append(row)
    return rows, [], []


def _contacts(layout: Layout, raw: bytes) -> Plan:
    """Makes one row per contact. Each row also contains the message's stamp and sum of forces.

    A message without contacts becomes one row with only the stamp and the sum of forces.
    """
    message = {path: leaf for path, leaf in layout.leaves.items() if not path.startswith("points/")}
    points: list[Columns] = [{} for _ in range(layout.counts["points"])]
    for path, leaf in layout.leaves.items():
        if path.startswith("points/"):
            _, index, value = path.split("/", 2)
            points[int(index)][value] = leaf
    return [message | point for point in points] or [message], [], []


def _diagnostics(layout: Layout, raw: bytes) -> Plan:
    """Makes one row per status, with a column for each key of the status."""
    leaves, counts, rows, keys = layout.leaves, layout.counts, [], []
    for index in range(counts["status"]):
        prefix = f"status/{index}/"
        row = {STAMP: leaves[STAMP]}
        row |= {field: leaves[prefix + field] for field in ("name", "level", "message", "hardware_id")}
        for value in range(counts[prefix + "values"]):
            key = leaves[f"{prefix}values/{value}/key"]
            row[f"values/{key.text(raw)}"] = leaves[f"{prefix}values/{value}/value"]
            keys.append(key)
        rows.append(row)
    return rows, keys, []


PLANS: dict[str, Callable[[Layout, bytes], Plan]] = {
    "sensor_msgs/JointState": _joint_state,
    "tf2_msgs/TFMessage": _transforms,
    "tf/tfMessage": _transforms,
    "diagnostic_msgs/DiagnosticArray": _diagnostics,
    "ros_pybullet_interface/Contacts": _contacts,
}


def _rename_reserved(row: Columns) -> Columns:
    """Renames fields called `time` or `record_time`, since the index and a column of every table have these names."""
    return {f"{name}_" if name in (INDEX, RECORD_TIME) else name: leaf for name, leaf in row.items()}


def _merge(spans: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Joins touching spans, so that fewer spans have to be compared."""
    merged: list[tuple[int, int]] = []
    for start, stop in sorted(spans):
        if merged and start <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(stop, merged[-1][1]))
        else:
            merged.append((start, stop))
    return merged
