"""Which rows and columns messages become."""

from __future__ import annotations

import struct
from collections.abc import Callable

from rpbi_data.bags.message_layout import MAX_ARRAY_COLUMNS, MessageType
from rpbi_data.bags.row_plan import plan_rows

Pack = Callable[..., bytes]


def test_joints_are_columns_by_name(joint_state_type: MessageType, pack_joint_state: Pack) -> None:
    plan = plan_rows(joint_state_type, pack_joint_state(1, ["b", "a"], [1.0, 2.0], [], [3.0, 4.0]))
    (row,) = plan.rows
    assert [name for name in row if "header" not in name] == [
        "position/b",
        "position/a",
        "effort/b",
        "effort/a",
    ]
    assert plan.notes == []


def test_equal_messages_share_the_names_of_joints(joint_state_type: MessageType, pack_joint_state: Pack) -> None:
    first = pack_joint_state(1, ["a", "b"], [1.0, 2.0])
    swapped = pack_joint_state(1, ["b", "a"], [1.0, 2.0])
    later = pack_joint_state(9, ["a", "b"], [5.0, 6.0])
    fixed = plan_rows(joint_state_type, first).fixed

    def shared(raw: bytes) -> list[bytes]:
        return [raw[start:stop] for start, stop in fixed]

    assert shared(first) == shared(later)
    assert shared(first) != shared(swapped)


def test_values_without_matching_joints_are_left_out_and_named(
    joint_state_type: MessageType, pack_joint_state: Pack
) -> None:
    plan = plan_rows(joint_state_type, pack_joint_state(1, ["a", "b"], [1.0], [1.0, 2.0]))
    assert [name for name in plan.rows[0] if "header" not in name] == ["velocity/a", "velocity/b"]
    assert plan.notes == ["1 values of 'position' for 2 joints: left out"]


def test_joints_without_names_are_numbered(joint_state_type: MessageType, pack_joint_state: Pack) -> None:
    plan = plan_rows(joint_state_type, pack_joint_state(1, [], [1.0, 2.0]))
    assert [name for name in plan.rows[0] if "header" not in name] == ["position/0", "position/1"]


def test_fields_named_like_index_or_record_time_are_renamed() -> None:
    plan = plan_rows(MessageType.parse("a_msgs/A", "float32 time\nfloat32 record_time\nfloat32 x"), bytes(12))
    assert list(plan.rows[0]) == ["time_", "record_time_", "x"]


def test_long_arrays_of_messages_are_left_out_and_named() -> None:
    path = MessageType.parse("a_msgs/Path", f"int8 x\nB[] points\n{'=' * 80}\nMSG: a_msgs/B\nint8 y\n")
    count = MAX_ARRAY_COLUMNS + 1
    plan = plan_rows(path, struct.pack("<bI", 0, count) + bytes(count))
    assert list(plan.rows[0]) == ["x"]
    assert plan.notes == [f"'points' has over {MAX_ARRAY_COLUMNS} elements: left out"]
