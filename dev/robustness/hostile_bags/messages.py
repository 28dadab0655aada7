"""Definitions and serialised messages of types with special rows, and a bag of one topic."""

from __future__ import annotations

import struct
from pathlib import Path

from .records import Bag, Topic, text, uint32

LINE = "=" * 80
HEADER = f"{LINE}\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
JOINT_STATE = f"Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n{HEADER}"
DIAGNOSTICS = (
    f"Header header\ndiagnostic_msgs/DiagnosticStatus[] status\n{HEADER}{LINE}\nMSG: diagnostic_msgs/DiagnosticStatus\n"
    f"byte level\nstring name\nstring message\nstring hardware_id\nKeyValue[] values\n{LINE}\n"
    "MSG: diagnostic_msgs/KeyValue\nstring key\nstring value\n"
)
KNOWN = (
    *("sensor_msgs/JointState", "tf2_msgs/TFMessage", "tf/tfMessage", "diagnostic_msgs/DiagnosticArray"),
    *("ros_pybullet_interface/Contacts", "std_msgs/Header", "std_msgs/String"),
)
STEP_NS = 1_000_000


def write_one_topic(path: Path, topic: Topic, *raws: bytes, **changes: object) -> None:
    """Writes a bag of one topic, with a chunk for its messages."""
    Bag([topic], [[(0, 10**9 + index * STEP_NS, raw) for index, raw in enumerate(raws)]], **changes).write(path)


def joint_state(names: list[str | bytes], values: int | None = None, stamp_s: int = 1) -> bytes:
    count = len(names) if values is None else values
    array = uint32(count) + struct.pack(f"<{count}d", *[0.5] * count)
    joints = uint32(len(names)) + b"".join(map(text, names))
    return struct.pack("<III", 0, stamp_s, 0) + text("") + joints + array + uint32(0) + uint32(0)
