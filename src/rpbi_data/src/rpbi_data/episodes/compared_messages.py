"""Compares recorded messages with the messages of a replay."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from io import BytesIO
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import genpy

from custom_ros_tools.errors import shortened
from custom_ros_tools.foreign import printable
from ros_pybullet_interface.msg import SimulationState
from rpbi.ros.headers import use_own_frames, use_prefix
from rpbi.ros.publishers.status import STATE
from rpbi.ros.publishers.transforms import TF
from rpbi.world import World
from rpbi_data.bags.bag_reader import BagMessage, BagReader
from rpbi_data.bags.times import PER_SECOND, to_seconds
from rpbi_data.bags.topic_report import message_time_ns

from .sample_messages import SampleMessages

WINDOW_NS = 2 * PER_SECOND
"""Longest time from a message's stamp to its recording [ns]; messages recorded later are not compared."""


class TopicDifference(NamedTuple):
    """The first difference between the recorded messages of a topic and the messages of the replay.

    Attributes:
        topic: The topic.
        stamp_ns: Stamp of the message [ns].
        place: Path of the differing value in the message.
        expected: The value in the replay.
        recorded: The value in the bag.
        is_certain: Whether the message depends only on the state of the world, so that the bag must have been changed.
    """

    topic: str
    stamp_ns: int
    place: str
    expected: Any
    recorded: Any
    is_certain: bool

    def __str__(self) -> str:
        values = (shortened(printable(str(each))) for each in (self.expected, self.recorded))
        at = f"{printable(self.topic)} at {to_seconds(self.stamp_ns):.9f} s: {self.place}"
        return "{}: expected {}, recorded {}".format(at, *values)


class Compared(NamedTuple):
    """Result of comparing recorded messages with a replay.

    Attributes:
        differences: The first difference of each topic, indexed by topic.
        different: Number of differing messages (on TF: transforms), indexed by topic.
        compared: Number of compared messages (on TF: transforms), indexed by topic.
    """

    differences: dict[str, TopicDifference]
    different: Counter[str]
    compared: Counter[str]

    @classmethod
    def merged(cls, parts: Iterable[Compared]) -> Compared:
        """Merges the results of consecutive parts of an episode."""
        whole = cls({}, Counter(), Counter())
        for each in parts:
            whole = cls(each.differences | whole.differences, *(a + b for a, b in zip(whole[1:], each[1:])))
        return whole


class Comparison:
    """Compares the messages of an episode with the sensor samples of a replay. Context manager that closes the bag.

    Messages are compared if topic and stamp are the same, and transforms if child frame and stamp are the same.
    Images, messages without a header, and messages whose stamp does not occur in the replay are not compared.

    Args:
        bag: Path of the recorded bag.
        namespace: Namespace of the simulator.

    Attributes:
        result: Result of the comparison so far.
    """

    def __init__(self, bag: Path, namespace: str) -> None:
        self._bag = BagReader(bag, any_size=True)
        self._prefix = f"/{namespace.strip('/')}/".replace("//", "/")
        state = self._full(STATE.name)
        states = [_parsed(SimulationState, each.raw) for each in self._bag.messages([state])]
        self._states = [each for each in states if each is not None]
        own = {state, *(self._full(f"rpbi/{name}") for name in ("commands", "world_description"))}
        types = {topic: {each.name for each in kinds} for topic, kinds in self._bag.types.items()}
        self._topics = {topic for topic, kinds in types.items() if topic not in own and not kinds & _NOT_COMPARED}
        self._messages = self._bag.messages(self._topics)
        self._coming = next(self._messages, None)
        self._waiting: dict[tuple[str, str, int], list[Any]] = {}
        self._swept_ns = 0
        self._stamps: _Stamps | None = None
        self._samples: SampleMessages | None = None
        self.result = Compared({}, Counter(), Counter())

    def __enter__(self) -> Comparison:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self._bag.__exit__()

    def observe(self, world: World, resets: int, samples: Sequence[Any]) -> None:
        """Compares the sensor samples of one tick of the replay with the recording.

        Args:
            world: The world of the replay.
            resets: Number of resets between the start of the world and this tick.
            samples: Sensor samples of the tick.
        """
        if self._samples is None or self._stamps is None:
            use_prefix(world.config.tf_prefix)
            use_own_frames(world.frames())
            self._samples = SampleMessages(world, lambda topic: self._full(topic) in self._topics)
            self._stamps = _Stamps(self._states, world.clock.dt_ns)
        stamp_ns = self._stamps.of(resets, world.clock.tick)
        if stamp_ns is None or not samples:
            return
        self._read_until(stamp_ns + WINDOW_NS)
        for topic, expected in self._samples.of(samples, stamp_ns):
            full = self._full(topic)
            if topic == TF.name:
                for each in expected.transforms:
                    for recorded in self._taken(full, each.child_frame_id, each.header.stamp.to_nsec()):
                        self._compare(topic, each, recorded)
            elif expected._has_header:
                for message in self._taken(full, "", expected.header.stamp.to_nsec()):
                    self._compare(topic, expected, _parsed(type(expected), message.raw))

    def _compare(self, topic: str, expected: Any, recorded: Any) -> None:
        assert self._samples is not None
        full = self._full(topic)
        self.result.compared[full] += 1
        other = "its type", expected._type, "another one"
        found = other if recorded is None else _difference(_as_sent(expected), recorded, "")
        if found is not None:
            self.result.different[full] += 1
            if full not in self.result.differences:
                stamp_ns, is_certain = expected.header.stamp.to_nsec(), not self._samples.keeps_state(topic)
                place, ours, theirs = found
                self.result.differences[full] = TopicDifference(full, stamp_ns, place, ours, theirs, is_certain)

    def _read_until(self, time_ns: int) -> None:
        """Reads the messages that were recorded up to a time [ns], and drops messages with much older stamps."""
        oldest = time_ns - 5 * WINDOW_NS
        while self._coming is not None and self._coming.record_time_ns <= time_ns:
            if self._coming.record_time_ns > oldest:  # older messages are not needed: a replay may begin at a keyframe
                self._keep(self._coming)
            self._coming = next(self._messages, None)
        if oldest > self._swept_ns:
            self._swept_ns = time_ns
            self._waiting = {key: each for key, each in self._waiting.items() if key[2] > oldest}

    def _keep(self, message: BagMessage) -> None:
        if message.topic == TF.name:
            parsed = _parsed(TF.message_type, message.raw)
            for each in parsed.transforms if parsed is not None else ():
                key = message.topic, each.child_frame_id, each.header.stamp.to_nsec()
                self._waiting.setdefault(key, []).append(each)
        elif message.type.has_header:
            self._waiting.setdefault((message.topic, "", message_time_ns(message)), []).append(message)

    def _taken(self, topic: str, frame: str, stamp_ns: int) -> list[Any]:
        return self._waiting.pop((topic, frame, stamp_ns), [])

    def _full(self, topic: str) -> str:
        return topic if topic.startswith("/") else f"{self._prefix}{topic}"


_NOT_COMPARED = {"sensor_msgs/Image", "sensor_msgs/CompressedImage", "sensor_msgs/PointCloud2", "rosgraph_msgs/Clock"}


class _Stamps:
    """Computes the stamps of ticks from recorded states.

    Args:
        states: The recorded states.
        dt_ns: Length of a tick [ns].
    """

    def __init__(self, states: Iterable[SimulationState], dt_ns: int) -> None:
        self._dt_ns = dt_ns
        self._starts: dict[int, set[int]] = {}
        self._by_tick: dict[tuple[int, int], set[int]] = {}
        for each in states:
            stamp_ns = each.header.stamp.to_nsec()
            self._starts.setdefault(each.resets, set()).add((stamp_ns - each.tick * dt_ns) // dt_ns)
            self._by_tick.setdefault((each.resets, each.tick), set()).add(stamp_ns)

    def of(self, resets: int, tick: int) -> int | None:
        """Returns the stamp of a tick [ns]; None if unknown, for instance while a world in wall time was paused.

        Args:
            resets: Number of resets before the tick.
            tick: Number of the tick since the reset.
        """
        starts = self._starts.get(resets, set())
        if len(starts) == 1:  # simulated time, in which stamps follow the ticks
            return (min(starts) + tick) * self._dt_ns
        stamps = self._by_tick.get((resets, tick), set())
        return min(stamps) if len(stamps) == 1 else None


def _parsed(kind: type, raw: bytes) -> Any:
    """Deserialises a message; returns None if the bytes are not a message of this type."""
    message = kind()
    try:
        message.deserialize(raw)
    except (genpy.DeserializationError, UnicodeDecodeError):
        return None
    return message


def _as_sent(message: Any) -> Any:
    """Serialises and deserialises a message, so that its numbers have the precision of sent messages."""
    data = BytesIO()
    message.serialize(data)
    return _parsed(type(message), data.getvalue())


def _difference(expected: Any, recorded: Any, place: str) -> tuple[str, Any, Any] | None:
    """Returns the path of the first differing value, and both values; None if all values except `seq` are equal."""
    if isinstance(expected, genpy.Message):
        names = [name for name in expected.__slots__ if name != "seq"]
        parts = [(getattr(expected, name), getattr(recorded, name), f"{place}.{name}".lstrip(".")) for name in names]
    elif isinstance(expected, (list, tuple)):
        if len(expected) != len(recorded):
            return place, f"{len(expected)} values", f"{len(recorded)} values"
        parts = [(*pair, f"{place}[{number}]") for number, pair in enumerate(zip(expected, recorded))]
    else:
        is_nan = isinstance(expected, float) and math.isnan(expected) and math.isnan(recorded)
        return None if expected == recorded or is_nan else (place, expected, recorded)
    return next((found for part in parts if (found := _difference(*part))), None)
