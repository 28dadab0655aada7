"""The bridge's participant in a DDS domain: writers and readers with the qualities of service of ROS 2."""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from custom_ros_tools.errors import InterfaceError, MissingDependency
from rpbi_data.bags.message_layout import VARIABLE

try:
    from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsParticipant, BuiltinTopicDcpsPublication
    from cyclonedds.core import DDSException, DDSStatus, InstanceState, WaitSet
    from cyclonedds.domain import Domain, DomainParticipant
    from cyclonedds.pub import DataWriter
    from cyclonedds.qos import Policy, Qos
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic
    from cyclonedds.util import duration
except ImportError:
    raise MissingDependency("cyclonedds", "./rpbi setup ros2") from None

from .config import LOOPBACK, BridgeConfig
from .dds_types import Sample, dds_class
from .layouts import Ros2Type
from .type_hash import type_hash

BRIDGE = b"rpbi_ros2 "
"""Beginning of the user data by which bridges recognize each other."""
PREFIX = "rt"
"""Beginning of the names of topics of ROS 2 in DDS."""
DEPTH, LARGE_DEPTH = 1000, 30
"""Messages that are kept for a slow reader: 1 s at 1 kHz, and of messages with blocks of bytes 1 s at 30 Hz."""
BLOCKING_S = 0.0
"""Longest time for which a writer waits for readers [s]."""
MAX_TAKEN = 256
"""Most messages that are taken from a reader at once."""
MAX_ENDPOINTS = 10_000
"""Most programs or publishers in a domain that are looked at."""
MEET_PERIOD_S = 0.05
LOCAL_FRAGMENT, FRAGMENT = "64000", "1300"
"""Sizes of the parts of large messages, on the loopback interface and on others [bytes]."""
CONFIG = """\
<CycloneDDS><Domain>
  <General>
    <Interfaces><NetworkInterface name="{interface}"/></Interfaces>
    <MaxMessageSize>65500B</MaxMessageSize><FragmentSize>{fragment}B</FragmentSize>
  </General>
  <Discovery>
    <ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>60</MaxAutoParticipantIndex>{peers}
  </Discovery>
  <Internal>
    <Watermarks><WhcHigh>64MB</WhcHigh></Watermarks>
    <BurstSize><MaxInitTransmit>131072</MaxInitTransmit><MaxRexmit>131072B</MaxRexmit></BurstSize>
  </Internal>
  <Tracing><Verbosity>none</Verbosity></Tracing>
</Domain></CycloneDDS>"""
"""Configuration of Cyclone DDS. Bursts fit into the usual buffer of a socket, 208 KiB; readers ask for the rest."""


class Bridge(NamedTuple):
    """A bridge in the domain, as its user data describe it. The older one of two stays.

    Attributes:
        started_ns: Time of its start, since 1970 [ns].
        place: Its computer and process.
        prefix: Prefix of its topics.
    """

    started_ns: int
    place: str
    prefix: str

    @property
    def user_data(self) -> bytes:
        """The user data."""
        return BRIDGE + json.dumps(self).encode()

    @classmethod
    def parse(cls, user_data: bytes) -> Bridge | None:
        """Returns the bridge that user data describe; None if they are of another program."""
        if not user_data.startswith(BRIDGE):
            return None
        try:
            started_ns, place, prefix = json.loads(user_data[len(BRIDGE) :])
            return cls(int(started_ns), str(place)[:100], str(prefix))
        except (ValueError, TypeError, RecursionError):
            return None


class DdsWriter:
    """Writes messages to a topic of ROS 2.

    Args:
        writer: The writer of Cyclone DDS.
        sample_class: Class of its samples.
        keeps_last: Whether readers that come later receive the last message.
    """

    def __init__(self, writer: DataWriter[Sample], sample_class: type[Sample], keeps_last: bool) -> None:
        self._writer, self._sample_class, self.keeps_last = writer, sample_class, keeps_last

    @property
    def is_matched(self) -> bool:
        """Whether there are readers."""
        return self._writer.get_publication_matched_status().current_count > 0

    def write(self, cdr: bytes) -> None:
        """Writes a message in CDR.

        Raises:
            ValueError: If it could not be written.
        """
        try:
            self._writer.write(self._sample_class(cdr))
        except DDSException as error:
            raise ValueError(str(error)) from None

    def close(self) -> None:
        """Ends the writer."""
        self._writer._delete(self._writer._ref)


class DdsReader:
    """Reads messages of a topic of ROS 2.

    Args:
        reader: The reader of Cyclone DDS.
        on_close: Function that gets the reader before its end.
    """

    def __init__(self, reader: DataReader[Sample], on_close: Callable[[DataReader[Sample]], None]) -> None:
        self._reader, self._on_close = reader, on_close

    @property
    def is_matched(self) -> bool:
        """Whether there are writers."""
        return self._reader.get_subscription_matched_status().current_count > 0

    @property
    def is_refused(self) -> bool:
        """Whether there was a writer with another quality of service, such as best effort."""
        return int(self._reader.get_requested_incompatible_qos_status().total_count) > 0

    def take(self) -> list[bytes]:
        """Returns messages that have arrived, in CDR; at most `MAX_TAKEN`."""
        taken: list[Any] = self._reader.take(MAX_TAKEN)
        return [sample.cdr for sample in taken if sample.sample_info.valid_data]

    def close(self) -> None:
        """Ends the reader."""
        self._on_close(self._reader)


class DdsParticipant:
    """The bridge's participant in a domain.

    Args:
        config: The parameters of the bridge.

    Raises:
        InterfaceError: If the network interface or the domain cannot be used.
    """

    def __init__(self, config: BridgeConfig) -> None:
        config.check_interface()
        self.domain_id = config.domain()
        self._bridge = Bridge(time.time_ns(), f"{socket.gethostname()}, process {os.getpid()}", config.prefix)
        is_local = config.interface == LOOPBACK
        try:
            self._domain = Domain(
                self.domain_id,
                CONFIG.format(
                    interface=config.interface,
                    fragment=LOCAL_FRAGMENT if is_local else FRAGMENT,
                    peers="<Peers><Peer address='127.0.0.1'/></Peers>" if is_local else "",
                ),
            )
            self._participant = DomainParticipant(self.domain_id, Qos(Policy.Userdata(self._bridge.user_data)))
        except DDSException as error:
            where = f"domain {self.domain_id} on the interface {config.interface}"
            raise InterfaceError(f"ROS 2 cannot be reached in {where}: {error}") from None
        self._waiting = WaitSet(self._participant)
        self._classes: dict[str, type[Sample]] = {}
        self._participants = _Discovered(BuiltinDataReader(self._participant, BuiltinTopicDcpsParticipant))
        self._publications = _Discovered(BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication))

    def writer(self, name: str, message_type: Ros2Type, keeps_last: bool = False) -> DdsWriter:
        """Opens a writer.

        Args:
            name: Full name of the topic in ROS 2.
            message_type: Type of the messages.
            keeps_last: Whether readers that come later receive the last message.
        """
        topic = self._topic(name, message_type)
        durability = [
            Policy.Durability.TransientLocal,
            Policy.DurabilityService(0, Policy.History.KeepLast(1), -1, -1, -1),
        ]
        qos = _qos(message_type, depth_of(message_type), *durability if keeps_last else [Policy.Durability.Volatile])
        return DdsWriter(DataWriter(self._participant, topic, qos), topic.data_type, keeps_last)

    def reader(self, name: str, message_type: Ros2Type) -> DdsReader:
        """Opens a reader.

        Args:
            name: Full name of the topic in ROS 2.
            message_type: Type of the messages.
        """
        reader = DataReader(
            self._participant, self._topic(name, message_type), _qos(message_type, DEPTH, Policy.Durability.Volatile)
        )
        reader.set_status_mask(DDSStatus.DataAvailable)
        self._waiting.attach(reader)
        return DdsReader(reader, self._close_reader)

    def wait(self, timeout_s: float) -> None:
        """Waits until a reader has messages, or a time has passed [s]."""
        self._waiting.wait(duration(seconds=timeout_s))

    def meet(self, time_s: float) -> None:
        """Looks for an older bridge with the same topics in the domain, for some time [s].

        Raises:
            InterfaceError: If there is one.
        """
        end_s = time.monotonic() + time_s
        while time.monotonic() < end_s:
            self.check_bridges()
            time.sleep(MEET_PERIOD_S)

    def check_bridges(self) -> None:
        """Checks that no older bridge has the same topics in the domain.

        Raises:
            InterfaceError: If there is one.
        """
        for qos in (each.qos for each in self._participants.alive):
            other = Bridge.parse(qos[Policy.Userdata].data) if Policy.Userdata in qos else None
            if other is not None and other.prefix == self._bridge.prefix and other < self._bridge:
                raise InterfaceError(
                    f"another bridge connects domain {self.domain_id} already ({other.place}): end it, "
                    "or set ~domain_id or ~prefix of this one"
                )

    def topics_of_others(self) -> set[str]:
        """Returns the names in ROS 2 of topics that other programs publish."""
        ours = self._participant.guid
        others = (each for each in self._publications.alive if each.participant_key != ours)
        return {each.topic_name.removeprefix(PREFIX) for each in others if each.topic_name.startswith(f"{PREFIX}/")}

    def _topic(self, name: str, message_type: Ros2Type) -> Topic[Sample]:
        return Topic(self._participant, f"{PREFIX}{name}", dds_class(message_type, self._classes))

    def _close_reader(self, reader: DataReader[Sample]) -> None:
        self._waiting.detach(reader)


class _Discovered:
    """Participants or publications in the domain.

    A reading takes milliseconds, in which messages wait for Python's lock: only changes are read.

    Args:
        reader: Reader of what Cyclone DDS has discovered.
    """

    def __init__(self, reader: BuiltinDataReader) -> None:
        self._reader = reader
        self._alive: list[Any] = []

    @property
    def alive(self) -> list[Any]:
        """Those that have not ended."""
        if self._reader.get_status_changes() & DDSStatus.DataAvailable:  # a reading clears it
            samples: list[Any] = self._reader.read(MAX_ENDPOINTS)
            self._alive = [
                each
                for each in samples
                if each.sample_info.valid_data and each.sample_info.instance_state == InstanceState.Alive
            ]
        return self._alive


def _qos(message_type: Ros2Type, depth: int, *policies: Any) -> Qos:
    """Returns the qualities of service of reliable writers and readers, with the hash of the type as in ROS 2."""
    return Qos(
        Policy.Reliability.Reliable(duration(seconds=BLOCKING_S)),
        Policy.History.KeepLast(depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.IgnoreLocal.Participant,
        Policy.Userdata(f"typehash={type_hash(message_type)};".encode()),
        *policies,
    )


def depth_of(message_type: Ros2Type) -> int:
    """Returns how many messages a writer keeps for a slow reader; fewer if they have blocks of bytes."""
    is_large = any(field.type == "uint8" and field.length == VARIABLE for field in message_type.fields)
    return LARGE_DEPTH if is_large else DEPTH
