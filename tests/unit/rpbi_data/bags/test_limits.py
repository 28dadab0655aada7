"""Bags that ask for more than anybody needs are refused in words, in time and memory in proportion to the file."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import pytest

from rpbi_data.bags import limits
from rpbi_data.bags.limits import BagError, Budget, LimitError
from rpbi_data.bags.message_layout import MessageType, lay_out
from rpbi_data.bags.row_plan import plan_rows
from rpbi_data.bags.tables import TableBuilder, file_stems

LINE = "=" * 80


def _types(*bodies: str) -> MessageType:
    """Returns a type of which the first body is, and types T1, T2, ... of the others."""
    sections = [f"{LINE}\nMSG: a_msgs/T{number}\n{body}\n" for number, body in enumerate(bodies[1:], 1)]
    return MessageType.parse("a_msgs/A", f"{bodies[0]}\n{''.join(sections)}")


def _nest(levels: int, last: str, length: str = "") -> MessageType:
    inner = [f"T{level}{length} a\nT{level}{length} b" for level in range(1, levels)]
    return _types(*inner, last)


@pytest.mark.parametrize("length", ["", "[2]"])
def test_nested_types_are_read_once_however_often_they_are_named(length: str) -> None:
    nested = _nest(45, "", length)  # 2^45 messages of nothing, in 3 kB
    assert nested.fields == () and not nested.holds_bytes
    assert lay_out(nested, b"").leaves == {}
    with pytest.raises(ValueError, match="it ends after 3 bytes"):
        lay_out(_nest(45, "uint8 x", length), bytes(3))
    assert _nest(45, "uint8[] x", length).holds_bytes


def test_a_definition_is_at_most_50_levels_deep() -> None:
    assert _nest(limits.MAX_DEPTH, "uint8 x").fields
    for levels in (limits.MAX_DEPTH + 1, 600):
        with pytest.raises(LimitError, match="a_msgs/A cannot be read: expected at most 50 levels"):
            _nest(levels, "uint8 x")


def test_a_definition_has_at_most_a_megabyte() -> None:
    with pytest.raises(LimitError, match="expected at most 1,048,576 bytes, got 1,048,577"):
        MessageType.parse("a_msgs/A", "#" * (2**20 + 1))


@pytest.mark.parametrize("length", ["[2000000000]", "[9999999999]"])
def test_arrays_of_nothing_take_no_time(length: str) -> None:
    nothing = _types(f"T1{length} x\nuint8 y", "T2 z", "")
    assert list(lay_out(nothing, b"\7").leaves) == ["y"]
    variable = _types("T1[] x\nuint8 y", "")
    assert lay_out(variable, struct.pack("<IB", 1, 7)).counts == {"x": 1}
    with pytest.raises(ValueError, match="it ends after 1 bytes"):
        lay_out(_types(f"T1{length} x", "uint8 y"), b"\7")


def test_message_values_and_name_bytes_are_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rpbi_data.bags.message_layout.MAX_VALUES", 4)
    assert len(lay_out(_types("uint8[4] x"), bytes(4)).leaves) == 4
    with pytest.raises(LimitError, match="expected at most 4 values in a message, got more"):
        lay_out(_types("uint8[5] x"), bytes(5))
    with pytest.raises(LimitError, match="expected at most 1,000 bytes in a name, got 1,001 in 'xxx"):
        lay_out(_types(f"uint8 {'x' * 1001}"), bytes(1))


Pack = Callable[..., bytes]


def test_the_name_of_a_column_has_at_most_1000_bytes(joint_state_type: MessageType, pack_joint_state: Pack) -> None:
    longest = limits.MAX_NAME_BYTES - len("position/")
    (row,) = plan_rows(joint_state_type, pack_joint_state(1, ["x" * longest], [1.0])).rows
    assert max(map(len, row)) == limits.MAX_NAME_BYTES
    for name in ("x" * (longest + 1), "\u00e4" * 500, "x" * 65_535):
        with pytest.raises(
            LimitError, match=r"expected at most 1,000 bytes in the name of a column, got [\d,]+ in 'pos"
        ):
            plan_rows(joint_state_type, pack_joint_state(1, [name], [1.0]))


def test_a_table_has_at_most_so_many_columns(
    joint_state_type: MessageType, pack_joint_state: Pack, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rpbi_data.bags.tables.MAX_COLUMNS", 10)
    builder = TableBuilder("/states")
    for index in range(11):
        builder.add(joint_state_type, pack_joint_state(1, [f"j{index}"], [1.0]), 10**9)
    with pytest.raises(LimitError, match="expected at most 10 columns, got 11"):
        builder.table()


@pytest.mark.parametrize(
    ("name", "definition", "raw"),
    [
        ("sensor_msgs/JointState", "float64[] name", struct.pack("<I", 1001) + bytes(8008)),
        ("sensor_msgs/JointState", "uint8 x", b"\1"),
        ("tf2_msgs/TFMessage", "uint8[] transforms", struct.pack("<IB", 1, 7)),
        ("diagnostic_msgs/DiagnosticArray", "string[] status", struct.pack("<II", 1, 0)),
        ("ros_pybullet_interface/Contacts", "string[] points", struct.pack("<II", 1, 0)),
        ("sensor_msgs/JointState", f"Header header\n{LINE}\nMSG: std_msgs/Header\nstring stamp", struct.pack("<I", 0)),
    ],
)
def test_known_types_with_other_definitions_have_a_row_a_message(name: str, definition: str, raw: bytes) -> None:
    builder = TableBuilder("/a", keep_binary=True)
    message_type = MessageType.parse(name, definition)
    builder.add(message_type, raw, 5 * 10**9)
    table = builder.table()
    assert list(table.index) == [5.0] and len(table.columns) > 1
    assert not message_type.has_header


def test_long_joint_states_are_kept(joint_state_type: MessageType, pack_joint_state: Pack) -> None:
    names = [f"j{index}" for index in range(1001)]
    plan = plan_rows(joint_state_type, pack_joint_state(1, names, [0.5] * 1001))
    assert plan.notes[-1] == "not as sensor_msgs/JointState usually is: one row a message"
    assert plan.rows[0]["position"].size == 8008


def test_columns_come_as_fields_appear_and_pieces_are_merged(monkeypatch: pytest.MonkeyPatch) -> None:
    text = MessageType.parse("a_msgs/A", "string a\nuint8 b\nbool c")
    monkeypatch.setattr("rpbi_data.bags.tables.MAX_PIECES", 7)
    builder = TableBuilder("/a")
    for index in range(50):
        builder.add(text, struct.pack("<I", index) + b"x" * index + bytes([index, index % 2]), index * 10**9)
    table = builder.table()
    assert list(table.columns) == ["record_time", "a", "b", "c"]
    assert table["a"].tolist() == ["x" * index for index in range(50)]
    assert table["b"].dtype == "uint8" and table["b"].tolist() == list(range(50)) and table["c"].dtype == bool


def test_a_budget_names_bag_topic_limit_and_remedy() -> None:
    now = 0.0
    budget = Budget(Path("/a.bag"), 1_000_000, False, clock=lambda: now)
    budget.check_time("/states")
    budget.set_cells("/states", 20_000_000, 10)
    with pytest.raises(
        BagError, match="^/a.bag: /tf: expected at most 200,000,000 cells in all tables, got 5 rows of 1 "
    ):
        budget.set_cells("/tf", 5, 1)
    now = 32.1
    with pytest.raises(BagError, match="^/a.bag: /tf: expected at most 32 s of processor time, got .*; --any-size, if"):
        budget.check_time("/tf")
    unlimited = Budget(Path("/a.bag"), 1, True, clock=lambda: now)
    now = 1e9
    unlimited.check_time("/tf")
    unlimited.set_cells("/tf", 10**9, 10**9)


def test_a_builder_asks_its_budget_for_each_layout() -> None:
    now = 0.0
    builder = TableBuilder("/a", budget=Budget(Path("/a.bag"), 0, False, clock=lambda: now))
    builder.add(MessageType.parse("a_msgs/A", "uint8 a"), b"\1", 10**9)
    now = 31.0
    with pytest.raises(BagError, match="/a.bag: /a: expected at most 30 s"):
        builder.table()


def test_topics_with_similar_or_long_names_get_distinct_file_names() -> None:
    stems = file_stems(["/a", "/a/", "/a.", "/a-2", "/" + "x" * 5000, "/" + "x" * 5001])
    assert len(set(stems.values())) == 6
    assert list(stems.values())[:2] == ["a", "a-2"]
    assert max(map(len, stems.values())) <= 202
