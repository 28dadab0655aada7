"""Checks and parses datagrams of the MVN network streaming protocol (rev. N, 2018).

Numbers are big-endian. Invalid datagrams raise a `PacketError`, whose reason is a key of `REASONS`.
"""

import re
import struct
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from custom_ros_tools.transforms import Array

from .segments import SEGMENTS

DEFAULT_PORT = 9763
HEADER = struct.Struct(">6sIBBIBBBBHH")
"""Header: ID, sample counter, datagram counter, number of items, time code, person, numbers of segments, props and
fingers, reserved, payload size.
"""
LAST = 0x80
"""Bit of the datagram counter that marks the last datagram of a message."""
MAX_PROPS, FINGERS = 4, 40
MAX_ITEMS = len(SEGMENTS) + MAX_PROPS + FINGERS
MAX_MAGNITUDE = 1e6
"""Largest allowed magnitude of a number, in any unit. Datagrams with larger numbers are refused."""

POSE_EULER, POSE_QUATERNION, UNITY = 1, 2, 5
PERSON_INFO, SCALE = 12, 13
JOINT_ANGLES, SEGMENT_MOTION, SEGMENT_ROTATION, TRACKERS, CENTER_OF_MASS, TIME_CODE = 20, 21, 22, 23, 24, 25
ITEMS: dict[int, tuple[int, tuple[int, ...]]] = {
    POSE_EULER: (1, (6,)),
    POSE_QUATERNION: (1, (7,)),
    JOINT_ANGLES: (2, (3,)),
    SEGMENT_MOTION: (1, (9,)),
    SEGMENT_ROTATION: (1, (10,)),
    TRACKERS: (1, (10, 16)),
    CENTER_OF_MASS: (0, (3, 9)),
}
"""For each type with items: number of ids at the start of an item, and possible numbers of values after the ids.

Each id and each value has 4 bytes.
"""
TEXTS = (PERSON_INFO, SCALE, TIME_CODE)
"""Types whose payload is not an array of items. Each message consists of a single datagram."""
REASONS = {
    "too short": "shorter than a header",
    "not MVN": "does not begin with MXTP and two digits",
    "type 05": "Unity's format: left-handed, in another order and relative to parents; choose Position + Orientation "
    "(Quaternion), type 02, in MVN's network streamer",
    "unknown type": "a type that is not supported",
    "size": "its size does not match its header",
    "counts": "its counts are invalid",
    "segment ids": "the ids of the segments are not 1 to 23",
    "not finite": "it has numbers that are not finite",
    "zero quaternion": "a quaternion is zero",
    "out of range": f"a number is larger than {MAX_MAGNITUDE:g}",
    "text": "its text is invalid",
    "too many people": "more people than max_people",
}
_EXPONENT = 0x7F800000
"""Exponent bits of infinity and NaN."""
_TIME_CODE = re.compile(rb"\d\d:\d\d:\d\d(\.\d{1,3})?")
_MIN_NORM = 1e-6
_MAX_NAME_BYTES = 64


class PacketError(ValueError):
    """A datagram is invalid. `reason` is a key of `REASONS`."""

    def __init__(self, reason: str, detail: str = "") -> None:
        self.reason = reason
        super().__init__(f"{REASONS[reason]}{detail and f': {detail}'}")


class Datagram(NamedTuple):
    """A parsed datagram, with the correct size and finite numbers.

    Attributes:
        kind: Message type, such as `POSE_QUATERNION`.
        sample: Sample counter, equal for all datagrams of a frame.
        part: Index of the datagram within its message, from 0.
        is_last: Whether the datagram is the last one of its message.
        time_ms: Time since the recording began [ms].
        person: Number of the person, from 0.
        ids: Ids at the start of the n items (n x 1 or n x 2); empty for the types in `TEXTS`.
        values: Values of the n items after the ids (n x m); empty for the types in `TEXTS`.
        text: Payload of a datagram whose type is in `TEXTS`; empty for other types.
    """

    kind: int
    sample: int
    part: int
    is_last: bool
    time_ms: int
    person: int
    ids: Array
    values: Array
    text: bytes


_NOTHING = np.zeros((0, 0))


def parse(data: bytes) -> Datagram:
    """Checks and parses a datagram.

    Raises:
        PacketError: If the datagram is invalid or of an unsupported type.
    """
    if len(data) < HEADER.size:
        raise PacketError("too short", f"{len(data)} bytes")
    name, sample, counter, items, time_ms, person, segments, props, fingers, _, size = HEADER.unpack_from(data)
    if name[:4] != b"MXTP" or not name[4:].isdigit():
        raise PacketError("not MVN", repr(name)[1:])
    kind = int(name[4:])
    if kind == UNITY:
        raise PacketError("type 05")
    if kind not in ITEMS and kind not in TEXTS:
        raise PacketError("unknown type", f"{kind:02}")
    payload = data[HEADER.size :]
    if size not in (0, len(payload)):
        raise PacketError("size", f"type {kind:02}, {size} bytes announced, {len(payload)} received")
    if segments not in (0, len(SEGMENTS)) or props > MAX_PROPS or fingers not in (0, FINGERS):
        raise PacketError("counts", f"{segments} segments, {props} props, {fingers} fingers")
    part, is_last = counter & ~LAST, bool(counter & LAST)
    if kind in TEXTS:
        return Datagram(kind, sample, part, is_last, time_ms, person, _NOTHING, _NOTHING, payload)
    ids, values = _items(kind, 1 if kind == CENTER_OF_MASS else items, payload)
    return Datagram(kind, sample, part, is_last, time_ms, person, ids, values, b"")


def _items(kind: int, count: int, payload: bytes) -> tuple[Array, Array]:
    id_count, lengths = ITEMS[kind]
    if not 0 < count <= MAX_ITEMS:
        raise PacketError("counts", f"type {kind:02}, {count} items")
    length, rest = divmod(len(payload), 4 * count)
    if rest or length - id_count not in lengths:
        raise PacketError("size", f"type {kind:02}, {count} items in {len(payload)} bytes")
    ids = np.frombuffer(payload, ">i4").reshape(count, length)[:, :id_count]
    bits = np.frombuffer(payload, ">u4").reshape(count, length)[:, id_count:]
    if ((bits & _EXPONENT) == _EXPONENT).any():  # checked before the conversion, where numpy may warn
        raise PacketError("not finite", f"type {kind:02}")
    values = bits.view(">f4").astype(float)
    if np.abs(values).max() > MAX_MAGNITUDE:
        raise PacketError("out of range", f"type {kind:02}")
    return ids, values


def body_rows(ids: Array) -> NDArray[np.intp]:
    """Returns the indices of the rows with the 23 segments of the body, in the order of `SEGMENTS`.

    Rows after the first 23 belong to props and fingers, and are ignored.

    Args:
        ids: Ids of the items in a message (n x 1).

    Raises:
        PacketError: If the first rows do not contain each segment once.
    """
    body = ids[: len(SEGMENTS), 0]
    order = np.argsort(body, kind="stable")
    if len(body) < len(SEGMENTS) or (body[order] != _IDS).any():
        raise PacketError("segment ids", ", ".join(map(str, body.tolist())))
    return order


_IDS = np.arange(1, len(SEGMENTS) + 1)


def unit_quats(quats: Array) -> tuple[Array, float]:
    """Returns the normalised quaternions (n x 4), and the original norm that differed most from 1.

    Raises:
        PacketError: If a quaternion is zero.
    """
    norms = np.sqrt(np.einsum("ij,ij->i", quats, quats))
    if norms.min() < _MIN_NORM:
        raise PacketError("zero quaternion", f"segment {SEGMENTS[int(norms.argmin())]}")
    return quats / norms[:, None], float(norms[np.abs(norms - 1.0).argmax()])


def info_in(text: bytes) -> dict[str, str]:
    """Returns the fields in a datagram of type 12 (person info), keyed by names such as `name`."""
    lines = re.findall(r"([\w ]{1,64}):[ \t]*([^\n\r\0]{0,256})", text[:4096].decode("ascii", "replace"))
    return {key.strip(): value.strip() for key, value in lines[:64]}


def time_code_in(text: bytes) -> str:
    """Returns the time of day in a datagram of type 25 (time code), as HH:MM:SS.mmm.

    Raises:
        PacketError: If the datagram contains no such time.
    """
    found = _TIME_CODE.search(text[:64])
    if found is None:
        raise PacketError("text", f"expected HH:MM:SS.mmm, got {text[:24]!r}")
    return found[0].decode()


def t_pose_in(text: bytes) -> dict[str, tuple[float, float, float]]:
    """Returns the segments' origins in the T-pose [m], keyed by segment, from a datagram of type 13 (scale).

    The result is empty for those datagrams of type 13 that contain points on the skin instead of segments.

    Raises:
        PacketError: If the size of the datagram does not match its counts, or a number is not finite.
    """
    reader = _PayloadReader(text)
    origins = {}
    for _ in range(reader.count(MAX_ITEMS)):
        name = reader.read(reader.count(_MAX_NAME_BYTES)).decode("ascii", "replace").replace(" ", "")
        origin = struct.unpack(">3f", reader.read(12))
        if not all(abs(value) <= MAX_MAGNITUDE for value in origin):
            raise PacketError("not finite", f"segment {name}")
        origins[name] = origin
    return origins


class _PayloadReader:
    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def count(self, most: int) -> int:
        (count,) = struct.unpack(">I", self.read(4))
        if count > most:
            raise PacketError("counts", f"{count}, at most {most} are possible")
        return int(count)

    def read(self, size: int) -> bytes:
        part = self._data[self._at : self._at + size]
        if len(part) < size:
            raise PacketError("size", "it ends within a segment")
        self._at += size
        return part
