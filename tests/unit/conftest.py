"""Small message types with their serialised messages, made by hand."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence

import pytest

from rpbi_data.bags.message_layout import MessageType

HEADER = f"{'=' * 80}\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"


@pytest.fixture
def joint_state_type() -> MessageType:
    return MessageType.parse(
        "sensor_msgs/JointState",
        f"Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n{HEADER}",
    )


def _text(text: str) -> bytes:
    data = text.encode()
    return struct.pack("<I", len(data)) + data


def _floats(values: Sequence[float]) -> bytes:
    return struct.pack(f"<I{len(values)}d", len(values), *values)


@pytest.fixture
def pack_joint_state() -> Callable[..., bytes]:
    """Serialises a joint state: stamp in whole seconds, names, and the three arrays."""

    def pack(
        stamp_s: int,
        names: Sequence[str],
        position: Sequence[float] = (),
        velocity: Sequence[float] = (),
        effort: Sequence[float] = (),
    ) -> bytes:
        header = struct.pack("<III", 0, stamp_s, 0) + _text("")
        joints = struct.pack("<I", len(names)) + b"".join(map(_text, names))
        return header + joints + _floats(position) + _floats(velocity) + _floats(effort)

    return pack
