"""Decodes datagrams of MVN into frames of people: grouped by person and sample, in metres, z up."""

from collections import Counter, deque
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from custom_ros_tools.transforms import Array

from . import packets
from .packets import Datagram, PacketError
from .segments import (
    SEGMENTS,
    CenterOfMass,
    JointAngles,
    Message,
    PersonInfo,
    SegmentFrame,
    SegmentMotion,
    TimeCode,
    TPose,
)

MAX_BEHIND = 100
"""Number of samples by which a datagram may be behind and count as late; further behind, the stream has restarted."""
MAX_LATE = 20
"""Number of consecutive late datagrams of a message type after which the stream counts as restarted, as when a short
recording is repeated.
"""
MAX_REFUSED = 1000
LONG_GONE = 500
"""Number of datagrams of others after which a person may be replaced by a new one, if there are too many."""
LENGTH_TOLERANCE = 0.01
_COUNTER_RANGE = 2**32
_METRES_PER_CM = 0.01


@dataclass
class _Group:
    """The newest message of one type of one person."""

    sample: int
    parts: dict[int, Datagram] = field(default_factory=dict)
    last: int | None = None
    is_done: bool = False
    late_in_a_row: int = 0


class StreamDecoder:
    """Assembles messages from datagrams, in any order of arrival; its memory is bounded for any input.

    A message is returned once all of its datagrams have arrived, and dropped when one of a newer sample arrives first.

    Args:
        position_scale: Factor of positions of types 02, 21 and 24 to metres.
        y_up: Whether those types have the y axis up, an option of MVN; otherwise z is up. Type 01 always has y up and
            is in centimetres.
        max_people: Largest number of people; messages of further ones are refused.

    Attributes:
        counts: `received` is the number of datagrams; each of them is `used`, `late`, `duplicate`, `incomplete` (its
            message was dropped), `ignored` (type 01 when type 02 is sent, too) or `refused: REASON`, or waits for the
            rest of its message. In addition, `frames` is the number of `SegmentFrame`s returned, and `skipped` the
            number of samples missing between those: they were lost or late, or MVN streams at a lower rate than it
            measures.
        refused: Reason of each refused datagram, of `packets.REASONS`, limited to the newest; may be emptied.
        refusals: Details of the newest refusal for each reason.
        remarks: Oddities, by subject; may be emptied.
    """

    def __init__(self, position_scale: float = 1.0, y_up: bool = False, max_people: int = 8) -> None:
        self.counts: Counter[str] = Counter()
        self.refused: deque[str] = deque(maxlen=MAX_REFUSED)
        self.refusals: dict[str, str] = {}
        self.remarks: dict[str, str] = {}
        self._scale, self._y_up, self._max_people = position_scale, y_up, max_people
        self._groups: dict[tuple[int, int], _Group] = {}
        self._people: dict[int, int] = {}
        """Value of `received` at the last datagram of each person."""
        self._frame_samples: dict[int, int] = {}

    def reset(self) -> None:
        """Drops the state of the stream, for instance after a silence; counts continue."""
        for group in self._groups.values():
            self._drop(group)
        self._groups.clear()
        self._people.clear()
        self._frame_samples.clear()

    @property
    def waiting(self) -> int:
        """Number of datagrams that wait for the rest of their messages."""
        return sum(len(group.parts) for group in self._groups.values())

    def decode(self, data: bytes) -> Message | None:
        """Decodes one datagram; returns the message that it completes, if any."""
        self.counts["received"] += 1
        try:
            datagram = packets.parse(data)
            self._admit(datagram.person)
            if datagram.kind in packets.TEXTS:
                message = _text_message(datagram)
                self.counts["used"] += 1
                return message
            return self._grouped(datagram)
        except PacketError as error:
            self._refuse(error, 1)
            return None

    def _refuse(self, error: PacketError, count: int) -> None:
        self.counts[f"refused: {error.reason}"] += count
        self.refused.extend([error.reason] * count)
        self.refusals[error.reason] = str(error)

    def _admit(self, person: int) -> None:
        """Admits a person; if there are too many, one without datagrams for long is replaced."""
        received = self.counts["received"]
        if person not in self._people and len(self._people) >= self._max_people:
            oldest = min(self._people, key=self._people.__getitem__)
            if received - self._people[oldest] < LONG_GONE:
                raise PacketError("too many people", f"person {person} beside {sorted(self._people)}")
            self._forget(oldest)
        self._people[person] = received

    def _forget(self, person: int) -> None:
        del self._people[person]
        self._frame_samples.pop(person, None)
        for key in [key for key in self._groups if key[0] == person]:
            self._drop(self._groups.pop(key))

    def _grouped(self, datagram: Datagram) -> Message | None:
        """Returns the message that a datagram completes."""
        group = self._group_of(datagram)
        if group is None:
            return None
        if group.is_done or datagram.part in group.parts:
            self.counts["duplicate"] += 1
            return None
        last = datagram.part if datagram.is_last else group.last
        if (datagram.is_last and group.last is not None) or any(
            last is not None and index > last for index in (datagram.part, *group.parts)
        ):
            raise PacketError("counts", f"datagram {datagram.part} of a message of {(group.last or 0) + 1}")
        group.parts[datagram.part], group.last = datagram, last
        if group.last is None or len(group.parts) <= group.last:
            return None
        parts = [group.parts[index] for index in range(group.last + 1)]
        group.parts, group.is_done = {}, True
        return self._completed(parts)

    def _group_of(self, datagram: Datagram) -> _Group | None:
        """Returns the group of a datagram, or None if the datagram is late."""
        key = (datagram.person, datagram.kind)
        group = self._groups.get(key)
        if group is not None:
            ahead = (datagram.sample - group.sample) % _COUNTER_RANGE
            if ahead == 0:
                return group
            behind = _COUNTER_RANGE - ahead
            if behind <= MAX_BEHIND and group.late_in_a_row < MAX_LATE:
                group.late_in_a_row += 1
                self.counts["late"] += 1
                return None
            self._drop(group)
        self._groups[key] = group = _Group(datagram.sample)
        return group

    def _drop(self, group: _Group) -> None:
        self.counts["incomplete"] += len(group.parts)
        group.parts = {}

    def _completed(self, parts: list[Datagram]) -> Message | None:
        first = parts[0]
        ids = np.concatenate([part.ids for part in parts])
        try:
            if len({part.values.shape[1] for part in parts}) > 1 or len(ids) > packets.MAX_ITEMS:
                raise PacketError("counts", f"{len(ids)} items in {len(parts)} datagrams")
            message = self._message(first, ids, np.concatenate([part.values for part in parts]))
        except PacketError as error:
            self._refuse(error, len(parts))
            return None
        self.counts["ignored" if message is None else "used"] += len(parts)
        if isinstance(message, SegmentFrame):
            self._count_frame(message)
        return message

    def _count_frame(self, frame: SegmentFrame) -> None:
        self.counts["frames"] += 1
        before = self._frame_samples.get(frame.person)
        self._frame_samples[frame.person] = frame.sample
        if before is not None:
            step = (frame.sample - before) % _COUNTER_RANGE
            if 0 < step <= MAX_BEHIND:
                self.counts["skipped"] += step - 1

    def _message(self, first: Datagram, ids: Array, values: Array) -> Message | None:
        kind, person, sample = first.kind, first.person, first.sample
        if kind == packets.POSE_QUATERNION or kind == packets.POSE_EULER:
            if kind == packets.POSE_EULER and (person, packets.POSE_QUATERNION) in self._groups:
                return None
            positions, quats_xyzw = self._poses(kind, values[packets.body_rows(ids)])
            return SegmentFrame(person, sample, first.time_ms, positions, quats_xyzw)
        if kind == packets.JOINT_ANGLES:
            parents, children = (tuple(map(_segment_of_point, column)) for column in ids.T.tolist())
            return JointAngles(person, sample, parents, children, np.radians(values))
        if kind == packets.CENTER_OF_MASS:
            position = self._scale * values[0, :3]
            return CenterOfMass(person, sample, position[_Z_UP] if self._y_up else position)
        return SegmentMotion(person, sample, kind, tuple(ids[:, 0].tolist()), values)

    def _poses(self, kind: int, values: Array) -> tuple[Array, Array]:
        """Returns positions [m] and quaternions x, y, z, w, z up."""
        if kind == packets.POSE_EULER:
            quats, scale, y_up = _quats_of_euler(values[:, 3:]), _METRES_PER_CM, True
        else:
            quats, length = packets.unit_quats(values[:, [4, 5, 6, 3]])
            scale, y_up = self._scale, self._y_up
            if abs(length - 1.0) > LENGTH_TOLERANCE:
                self.remarks["quaternions"] = f"have length {length:.3g} instead of 1; they are normalised"
        positions = scale * values[:, :3]
        return (positions[:, _Z_UP], quats[:, [*_Z_UP, 3]]) if y_up else (positions, quats)


_Z_UP = [2, 0, 1]
"""Components of a y-up vector that are x, y and z of a z-up one; a person faces z there, and x here."""


def _quats_of_euler(angles_deg: Array) -> Array:
    """Returns quaternions x, y, z, w of rotations about the fixed x, y and z axis in this order, as MVN's receiver
    does.
    """
    return np.asarray(Rotation.from_euler("xyz", angles_deg, degrees=True).as_quat())


def _segment_of_point(point: int) -> str:
    """Returns the segment of a point."""
    segment = point // 256
    if not 1 <= segment <= len(SEGMENTS):
        raise PacketError("segment ids", f"point {point}")
    return SEGMENTS[segment - 1]


def _text_message(datagram: Datagram) -> Message | None:
    person, text = datagram.person, datagram.text
    if datagram.kind == packets.PERSON_INFO:
        return PersonInfo(person, packets.info_in(text))
    if datagram.kind == packets.TIME_CODE:
        return TimeCode(person, datagram.sample, packets.time_code_in(text))
    origins = packets.t_pose_in(text)
    return TPose(person, origins) if origins else None
