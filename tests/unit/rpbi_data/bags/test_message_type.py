"""Message types from the definitions that bags carry."""

from __future__ import annotations

import pytest

from rpbi_data.bags.message_layout import SCALAR, VARIABLE, MessageType

LINE = "=" * 80
POSE = f"""\
# a comment
Header header
geometry_msgs/Point[2] corners   # fixed length
float64[] values
uint8 KIND=3
string TEXT=a # b = c
time[] times
{LINE}
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
{LINE}
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
"""


def test_fields_keep_order_length_and_nested_types_without_constants() -> None:
    message_type = MessageType.parse("a_msgs/Corners", POSE)
    assert [field.name for field in message_type.fields] == ["header", "corners", "values", "times"]
    assert [field.length for field in message_type.fields] == [SCALAR, 2, VARIABLE, VARIABLE]
    corner = message_type.fields[1].type
    assert isinstance(corner, MessageType) and corner.name == "geometry_msgs/Point"
    assert [field.type for field in corner.fields] == ["float64"] * 3
    assert message_type.fields[3].type == "time"


def test_types_of_the_same_package_need_no_prefix() -> None:
    message_type = MessageType.parse("a_msgs/A", f"B[] b\n{LINE}\nMSG: a_msgs/B\nint8 x\n")
    assert isinstance(message_type.fields[0].type, MessageType)


def test_only_a_header_that_comes_first_counts_as_header() -> None:
    header = f"{LINE}\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
    assert MessageType.parse("a_msgs/A", f"Header header\nint8 x\n{header}").has_header
    assert not MessageType.parse("a_msgs/A", f"int8 x\nHeader header\n{header}").has_header
    assert not MessageType.parse("a_msgs/A", f"std_msgs/Header[] headers\n{header}").has_header
    assert not MessageType.parse("std_msgs/Empty", "").has_header


@pytest.mark.parametrize(
    ("definition", "expected"),
    [("uint8[] data", True), ("char[] data", True), ("uint8[16] uuid", False), ("int32[] data", False)],
)
def test_binary_are_variable_arrays_of_bytes(definition: str, expected: bool) -> None:
    assert MessageType.parse("a_msgs/A", definition).holds_bytes is expected
    nested = MessageType.parse("a_msgs/A", f"B[] b\n{LINE}\nMSG: a_msgs/B\n{definition}\n")
    assert nested.holds_bytes is expected


@pytest.mark.parametrize(
    "definition",
    [
        "float64",
        "Unknown x",
        f"int8 x\n{LINE}\nint8 y\n",
        "A inner",  # contains itself
        f"int8 x\n{LINE}\nMSG: nonsense\nfloat x y z\n",
    ],
)
def test_a_broken_definition_is_named(definition: str) -> None:
    with pytest.raises(ValueError, match="definition of a_msgs/A cannot be read"):
        MessageType.parse("a_msgs/A", definition)
