"""Tables out of serialised messages."""

from __future__ import annotations

import struct
from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from rpbi_data.bags import tables
from rpbi_data.bags.message_layout import MessageType
from rpbi_data.bags.tables import TableBuilder
from rpbi_data.bags.times import ClockStep, clock_of

Pack = Callable[..., bytes]
NUMBER = MessageType.parse("std_msgs/Float64", "float64 data")
TEXT = MessageType.parse("std_msgs/String", "string data")


def _table(message_type: MessageType, raws: list[bytes], keep_binary: bool = False) -> pd.DataFrame:
    builder = TableBuilder("/topic", keep_binary)
    for index, raw in enumerate(raws):
        builder.add(message_type, raw, (100 + index) * 10**9)
    return builder.table()


def _text(text: bytes) -> bytes:
    return struct.pack("<I", len(text)) + text


def test_joints_keep_their_columns_when_order_and_set_change(
    joint_state_type: MessageType, pack_joint_state: Pack
) -> None:
    table = _table(
        joint_state_type,
        [
            pack_joint_state(1, ["a", "b"], [1.0, 2.0], [0.1, 0.2]),
            pack_joint_state(2, ["b", "a"], [4.0, 3.0]),
            pack_joint_state(3, ["b"], [5.0]),
            pack_joint_state(4, ["c", "a"], [7.0, 6.0], [0.7, 0.6]),
            pack_joint_state(5, ["a", "b"], [8.0, 9.0], [0.8, 0.9]),
        ],
    )
    assert list(table.index) == [1.0, 2.0, 3.0, 4.0, 5.0]
    joints = [f"{field}/{joint}" for field in ("position", "velocity") for joint in "abc"]
    assert list(table.columns) == ["record_time", "header/seq", "header/frame_id", *joints]
    nan = np.nan
    expected = [
        [1.0, 2.0, nan, 0.1, 0.2, nan],
        [3.0, 4.0, nan, nan, nan, nan],
        [nan, 5.0, nan, nan, nan, nan],
        [6.0, nan, 7.0, 0.6, nan, 0.7],
        [8.0, 9.0, nan, 0.8, 0.9, nan],
    ]
    np.testing.assert_array_equal(table[joints].to_numpy(), expected)


def test_columns_come_in_the_order_of_appearance(joint_state_type: MessageType, pack_joint_state: Pack) -> None:
    names = [["a"], ["longer"], ["c"], ["d", "a"]]
    table = _table(joint_state_type, [pack_joint_state(1, each, [0.0] * len(each)) for each in names])
    assert list(table.columns[3:]) == ["position/a", "position/longer", "position/c", "position/d"]


@pytest.mark.parametrize(("messages", "size"), [(1, 10**9), (2, 10**9), (7, 10**9), (10**9, 1), (10**9, 500)])
def test_batches_leave_no_trace(
    joint_state_type: MessageType,
    pack_joint_state: Pack,
    monkeypatch: pytest.MonkeyPatch,
    messages: int,
    size: int,
) -> None:
    random = np.random.default_rng(1)
    raws = []
    for index in range(50):
        names = list(random.permutation(["a", "bb", "ccc"]))[: random.integers(0, 4)]
        raws.append(pack_joint_state(index, names, random.random(len(names)), [], random.random(len(names))))
    whole = _table(joint_state_type, raws)
    monkeypatch.setattr(tables, "BATCH_MESSAGES", messages)
    monkeypatch.setattr(tables, "BATCH_BYTES", size)
    pd.testing.assert_frame_equal(_table(joint_state_type, raws), whole)


def test_rows_are_ordered_by_stamp_then_by_recording(joint_state_type: MessageType, pack_joint_state: Pack) -> None:
    stamps = [5, 3, 3, 4]
    table = _table(joint_state_type, [pack_joint_state(stamp, ["a"], [index]) for index, stamp in enumerate(stamps)])
    assert list(table.index) == [3.0, 3.0, 4.0, 5.0]
    assert list(table["position/a"]) == [1.0, 2.0, 3.0, 0.0]
    assert list(table["record_time"]) == [101.0, 102.0, 103.0, 100.0]


def test_record_time_replaces_a_zero_or_missing_stamp(joint_state_type: MessageType, pack_joint_state: Pack) -> None:
    table = _table(joint_state_type, [pack_joint_state(0, ["a"], [1.0]), pack_joint_state(200, ["a"], [2.0])])
    assert list(table.index) == [100.0, 200.0]
    assert list(_table(NUMBER, [struct.pack("<d", 1.0)]).index) == [100.0]


def test_variable_arrays_are_as_wide_as_the_longest() -> None:
    floats = MessageType.parse("a_msgs/A", "int32[] data")
    lengths = [2, 0, 12]
    table = _table(floats, [struct.pack(f"<I{n}i", n, *range(n)) for n in lengths])
    assert list(table.columns) == ["record_time", *(f"data/{index}" for index in range(12))]
    assert list(table.notna().sum(axis=1) - 1) == lengths
    assert list(table["data/1"].dropna()) == [1.0, 1.0]


def test_numbers_keep_their_type_unless_one_is_missing() -> None:
    kinds = [
        "bool",
        "int8",
        "uint8",
        "int16",
        "uint16",
        "int32",
        "uint32",
        "int64",
        "uint64",
        "float32",
        "float64",
    ]
    message_type = MessageType.parse("a_msgs/A", "\n".join(f"{kind} {kind}_" for kind in kinds))
    raw = struct.pack("<?bBhHiIqQfd", True, -1, 255, -2, 65535, -3, 2**32 - 1, -4, 2**64 - 1, 0.1, 0.1)
    row = _table(message_type, [raw, raw])
    assert [str(dtype) for dtype in row.dtypes[1:]] == kinds
    assert list(row.iloc[0])[1:] == [
        True, -1, 255, -2, 65535, -3, 2**32 - 1, -4, 2**64 - 1, np.float32(0.1), 0.1
    ]  # fmt: skip


def test_time_and_duration_are_seconds() -> None:
    message_type = MessageType.parse("a_msgs/A", "time t\nduration d")
    table = _table(message_type, [struct.pack("<IIii", 4_000_000_000, 500_000_000, -2, 250_000_000)])
    assert table["t"].iloc[0] == 4_000_000_000.5
    assert table["d"].iloc[0] == -1.75


def test_texts_of_equal_and_different_lengths_are_kept_apart() -> None:
    texts = [b"ab", b"cd", b"", b"ab", "ä".encode(), b"a\0"]
    assert list(_table(TEXT, [_text(text) for text in texts])["data"]) == [text.decode() for text in texts]


def test_messages_that_do_not_fit_are_left_out_and_counted(caplog: pytest.LogCaptureFixture) -> None:
    good = struct.pack("<d", 1.0)
    table = _table(NUMBER, [good, b"short", good, b"false"])
    assert list(table["record_time"]) == [100.0, 102.0]
    assert "/topic: a message does not fit its type: left out" in caplog.text
    assert "(messages: 2)" in caplog.text


def test_binary_data_is_kept_byte_for_byte_when_asked_for(caplog: pytest.LogCaptureFixture) -> None:
    image = MessageType.parse("a_msgs/Image", "uint8 width\nuint8[] data")
    cells = [b"\0\1\0", b"\0\1\0", b""]
    raws = [struct.pack("<BI", 7, len(cell)) + cell for cell in cells]
    assert list(_table(image, raws, keep_binary=True)["data"]) == cells
    assert caplog.text == ""
    assert list(_table(image, raws).columns) == ["record_time", "width"]
    assert "'data' is binary or long: left out" in caplog.text


def test_two_types_on_one_topic_share_a_table() -> None:
    builder = TableBuilder("/topic")
    builder.add(NUMBER, struct.pack("<d", 1.5), 1_000_000_000)
    builder.add(TEXT, _text(b"x"), 2_000_000_000)
    assert list(builder.table()["data"]) == [1.5, "x"]


def test_clock_set_back_and_mixed_message_types_are_reported(
    joint_state_type: MessageType, pack_joint_state: Pack, caplog: pytest.LogCaptureFixture
) -> None:
    _table(joint_state_type, [pack_joint_state(stamp, ["a"], [0.0]) for stamp in (5, 7, 6, 8)])
    assert caplog.text == ""  # by 1 s, as several publishers might
    _table(joint_state_type, [pack_joint_state(stamp, ["a"], [0.0]) for stamp in (5, 10, 3, 4)])
    assert "/topic: its clock was set back by 7 s at 10 s" in caplog.text
    builder = TableBuilder("/mixed")
    for time_s in range(4):
        builder.add(*((NUMBER, struct.pack("<d", 1.5)) if time_s else (TEXT, _text(b"x"))), time_s * 10**9)
    builder.table()
    came = "std_msgs/Float64 (messages: 3), std_msgs/String (messages: 1)"
    assert f"/mixed: expected messages of one type, got {came}" in caplog.text


def test_stamps_of_several_frames_are_not_compared() -> None:
    table = pd.DataFrame({"record_time": [1.0, 2.0, 3.0, 4.0], "child": ["b", "a", "b", "a"]}, [50.0, 10.0, 51.0, 11.0])
    assert not clock_of(table).is_fault
    assert clock_of(table.assign(child="a")) == ClockStep(50.0, 40.0)
    assert clock_of(table.assign(child=["b", "b", "a", "a"])) == ClockStep(50.0, 40.0)


def test_a_topic_without_messages_is_an_empty_table() -> None:
    table = TableBuilder("/topic").table()
    assert len(table) == 0
    assert table.index.name == "time" and list(table.columns) == ["record_time"]


def test_messages_without_fields_are_rows_with_a_time() -> None:
    empty = MessageType.parse("std_msgs/Empty", "")
    assert list(_table(empty, [b"", b""])["record_time"]) == [100.0, 101.0]
