"""Message types with fast serialisation, for messages that are sent often.

These types pack all fields in one call, and write the same bytes as the standard types.
"""

import struct
from collections.abc import Callable, Sequence
from functools import lru_cache
from io import BytesIO

from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage


class PackedJointState(JointState):
    """JointState with fast serialisation; the packing format is cached for each list of joint names."""

    def __init__(  # the constructor of the type takes five times as long
        self,
        header: Header | None = None,  # rospy creates received messages without arguments
        name: Sequence[str] = (),
        position: Sequence[float] = (),
        velocity: Sequence[float] = (),
        effort: Sequence[float] = (),
    ) -> None:
        self.header, self.name = header or Header(), name
        self.position, self.velocity, self.effort = position, velocity, effort

    def serialize(self, buff: BytesIO) -> None:
        """Writes the message to a buffer."""
        header, names = self.header, self.name
        try:
            pack, packed_names = _joint_state_format(header.frame_id, tuple(names))
            count = len(names)
            stamp = header.stamp
            buff.write(
                pack(
                    header.seq,
                    stamp.secs,
                    stamp.nsecs,
                    packed_names,
                    count,
                    *self.position,
                    count,
                    *self.velocity,
                    count,
                    *self.effort,
                )
            )
        except struct.error:  # a value is not a number, or a list is too short; the standard type names the error
            super().serialize(buff)


class PackedTransforms(TFMessage):
    """TFMessage with fast serialisation; the packing format is cached for each pair of frames."""

    def serialize(self, buff: BytesIO) -> None:
        """Writes the message to a buffer."""
        packed = [_COUNT.pack(len(self.transforms))]
        for each in self.transforms:
            header, place, turn = each.header, each.transform.translation, each.transform.rotation
            pack, frames = _transform_format(header.frame_id, each.child_frame_id)
            seq, stamp = header.seq, header.stamp
            packed.append(
                pack(seq, stamp.secs, stamp.nsecs, frames, place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w)
            )
        buff.write(b"".join(packed))


_COUNT = struct.Struct("<I")
_Format = tuple[Callable[..., bytes], bytes]
"""Function that packs the fields of a message, and the packed texts to pass to it."""


@lru_cache(maxsize=1000)
def _joint_state_format(frame: str, names: tuple[str, ...]) -> _Format:
    texts = _text(frame) + _COUNT.pack(len(names)) + b"".join(map(_text, names))
    numbers = f"I{len(names)}d"
    return struct.Struct(f"<3I{len(texts)}s{3 * numbers}").pack, texts


@lru_cache(maxsize=10_000)
def _transform_format(parent: str, child: str) -> _Format:
    texts = _text(parent) + _text(child)
    return struct.Struct(f"<3I{len(texts)}s7d").pack, texts


def _text(text: str) -> bytes:
    data = text.encode()
    return _COUNT.pack(len(data)) + data
