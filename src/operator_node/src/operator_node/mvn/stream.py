"""Assembles datagrams of MVN, by person and sample, into messages with positions in metres and z up."""

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
"""Largest number of samples by which a late datagram is behind. If it is further behind, the stream has restarted."""
MAX_LATE = 20
"""Number of consecutive late datagrams of a message type after which the stream counts as restarted.

This happens when a short recording is repeated.
"""
MAX_REFUSED = 1000
LONG_GONE = 500
"""Number of other people's datagrams after which a person who sends none may be replaced by a new person."""
LENGTH_TOLERANCE = 0.01
_COUNTER_RANGE = 2**32
_METRES_PER_CM = 0.01


@dataclass
class _Group:
    """Datagrams of the newest message, for one person and one message type."""

    sample: int
    parts: dict[int, Datagram] = field(default_factory=dict)
    last: int | None = None
    is_done: bool = False
    late_in_a_row: int = 0


class StreamDecoder:
    """Assembles messages from datagrams, which may arrive in any order. The memory is bounded for any input.

    A message is returned when its last missing datagram arrives. An incomplete message is dropped when a datagram of a
    newer sample arrives.

    Args:
        position_scale: Factor that converts positions of types 02 and 24 to metres.
        y_up: Whether MVN sends types 02 and 24 with the y axis up; otherwise z is up. Type 01 always has y up, and
            positions in centimetres.
        max_people: Largest number of people. Messages of further people are refused.

    Attributes:
        counts: Numbers of datagrams, keyed by result. `received` counts all datagrams. Each datagram is also counted
            as `used`, `late`, `duplicate`, `incomplete` (its message was dropped), `ignored` (type 01 if type 02 is
            sent, too) or `refused: REASON`, unless it waits for the rest of its message. Two further keys are
            `frames`, the number of returned `SegmentFrame`s, and `skipped`, the number of missing samples between these
            frames. Samples are missing if they are lost or late, or if MVN streams at a lower rate than it measures.
        refused: Reasons of the newest refused datagrams, from `packets.REASONS`. The caller may clear this queue.
        refusals: For each reason, details of the newest datagram that was refused for this reason.
        remarks: Descriptions of unusual data, keyed by subject. The caller may clear this dictionary.
    """

    def __init__(self, position_scale: float = 1.0, y_up: bool = False, max_people: int = 8) -> None:
        self.counts: Counter[str] = Counter()
        self.refused: deque[str] = deque(maxlen=MAX_REFUSED)
        self.refusals: dict[str, str] = {}
        self.remarks: dict[str, str] = {}
        self._scale, self._y_up, self._max_people = position_scale, y_up, max_people
        self._groups: dict[tuple[int, int], _Group] = {}
        self._people: dict[int, int] = {}
        """Value of `counts["received"]` at the last datagram of each person, keyed by the person's number."""
        self._frame_samples: dict[int, int] = {}

    def reset(self) -> None:
        """Drops all incomplete messages and known people, for instance after a silence. The counts are kept."""
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
        """Decodes one datagram. Returns the message if the datagram completes a message, otherwise None."""
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
        """Adds a person to the known people. If there are too many, replaces a person who has sent nothing for long.

        Raises:
            PacketError: If all known people are still sending.
        """
        received = self.counts["received"]
        if person not in self._people and len(self._people) >= self._max_people:
            oldest = min(self._people, key=self._people.__getitem__)
            if received - self._people[oldest] < LONG_GONE:
                raise PacketError("too many people", f"person {person} in addition to {sorted(self._people)}")
            self._forget(oldest)
        self._people[person] = received

    def _forget(self, person: int) -> None:
        del self._people[person]
        self._frame_samples.pop(person, None)
        for key in [key for key in self._groups if key[0] == person]:
            self._drop(self._groups.pop(key))

    def _grouped(self, datagram: Datagram) -> Message | None:
        """Adds a datagram to its group. Returns the message if the datagram completes a message, otherwise None."""
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
        """Converts values of type 01 or 02 to positions [m] and quaternions x, y, z, w, with z up."""
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
"""Indices of the components of a y-up vector that become x, y and z of a z-up vector.

A person in the T-pose faces z in y-up coordinates, and x in z-up coordinates.
"""


def _quats_of_euler(angles_deg: Array) -> Array:
    """Converts angles [deg] of rotations about the fixed axes x, y, z, in this order, to quaternions x, y, z, w.

    MVN's own receiver uses the same order.
    """
    return np.asarray(Rotation.from_euler("xyz", angles_deg, degrees=True).as_quat())


def _segment_of_point(point: int) -> str:
    """Returns the name of the segment to which a point belongs. `point` is 256 times the segment's id plus an index."""
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
