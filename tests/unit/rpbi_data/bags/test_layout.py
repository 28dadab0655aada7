"""Where values lie in serialised messages."""

from __future__ import annotations

import struct

import pytest

from rpbi_data.bags.message_layout import BYTES, MAX_ARRAY_COLUMNS, Leaf, MessageType, lay_out

MIXED = MessageType.parse("a_msgs/Mixed", "uint8 a\nstring text\nint16[2] pair\nfloat64[] values\ntime stamp\n")


def _mixed(text: bytes, values: list[float]) -> bytes:
    head = struct.pack("<BI", 1, len(text)) + text + struct.pack("<2hI", -1, 2, len(values))
    return head + struct.pack(f"<{len(values)}d2I", *values, 5, 6)


def test_values_lie_one_behind_the_other_without_padding() -> None:
    layout = lay_out(MIXED, _mixed(b"abc", [1.5, 2.5]))
    assert layout.leaves == {
        "a": Leaf("uint8", 0, 1),
        "text": Leaf("string", 5, 3),
        "pair/0": Leaf("int16", 8, 2),
        "pair/1": Leaf("int16", 10, 2),
        "values/0": Leaf("float64", 16, 8),
        "values/1": Leaf("float64", 24, 8),
        "stamp": Leaf("time", 32, 8),
    }
    assert layout.counts == {"pair": 2, "values": 2}
    assert layout.fixed == [(1, 5), (12, 16)]  # the lengths of text and values


def test_a_text_is_decoded_and_broken_utf8_does_no_harm() -> None:
    raw = _mixed("ä\0".encode() + b"\xff", [])
    assert lay_out(MIXED, raw).leaves["text"].text(raw) == "ä\0\ufffd"


@pytest.mark.parametrize("cut", range(1, len(_mixed(b"abc", [1.5]))))
def test_a_message_that_is_too_short_is_refused(cut: int) -> None:
    with pytest.raises(ValueError, match="byte"):
        lay_out(MIXED, _mixed(b"abc", [1.5])[:-cut])


def test_a_message_that_is_too_long_is_refused() -> None:
    with pytest.raises(ValueError, match="of which a_msgs/Mixed takes 32"):
        lay_out(MIXED, _mixed(b"abc", [1.5]) + b"\0")


@pytest.mark.parametrize(
    "definition",
    ["string x", "float64[] x", "string[] x", "uint8[] x", f"A[] x\n{'=' * 80}\nMSG: a_msgs/A\n"],
)
def test_a_false_length_does_not_run_away(definition: str) -> None:
    with pytest.raises(ValueError, match="a length of 4294967295 at byte 0, with 1 bytes left"):
        lay_out(MessageType.parse("a_msgs/B", definition), b"\xff\xff\xff\xff\0")


def test_bytes_and_long_arrays_stay_whole() -> None:
    image = MessageType.parse("a_msgs/Image", "uint8[] data\nuint8[2] pair")
    assert lay_out(image, b"\3\0\0\0abcde").leaves == {
        "data": Leaf(BYTES, 4, 3),
        "pair/0": Leaf("uint8", 7, 1),
        "pair/1": Leaf("uint8", 8, 1),
    }
    scan = MessageType.parse("a_msgs/Scan", "float32[] ranges")
    for count in (MAX_ARRAY_COLUMNS, MAX_ARRAY_COLUMNS + 1):
        leaves = lay_out(scan, struct.pack("<I", count) + bytes(4 * count)).leaves
        assert len(leaves) == (MAX_ARRAY_COLUMNS if count == MAX_ARRAY_COLUMNS else 1)
    assert leaves == {"ranges": Leaf(BYTES, 4, 4 * count)}
