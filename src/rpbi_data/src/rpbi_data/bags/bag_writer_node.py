"""Program that writes topics to a bag; `Recorder` starts it as a separate process.

All received messages are kept until they are written. In contrast, `rosbag record` buffers only 100 messages per
topic, and loses messages when it gets no processor time for a while.
"""

from __future__ import annotations

import argparse
import queue
import shutil
import signal
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import genpy
import rosbag
import rospy
from rosgraph_msgs.msg import Clock

from custom_ros_tools.ros.lifecycle.timed_master import allow_large_integers

from .recorded_topics import NOT_RECORDING

_POLL_S = 0.1
_FLUSH_S = 0.2
"""Time between two writes of buffered messages to the disk [s]; a killed recorder loses the buffered messages."""
_CLOCK = "/clock"
_HEADER = ("type", "md5sum", "message_definition", "callerid", "latching")


class _Arrival(NamedTuple):
    """A received message and its time of arrival in ROS time; the time is zero before the first /clock message."""

    topic: str
    time: genpy.Time
    message: rospy.AnyMsg


class BagWriter:
    """Writes topics to a bag with LZ4 compression, until `end` is called.

    The bag is called `NAME.bag.active` until it is closed. The node has to be started with `disable_rostime`. This
    class reads /clock itself, since rospy would subscribe to /clock before the bag exists.

    Args:
        path: Path of the bag.
        min_space_mb: Free disk space below which the recording ends [MB].
    """

    def __init__(self, path: Path, min_space_mb: float) -> None:
        self._path, self._min_space_mb = path, min_space_mb
        self._arrivals: queue.SimpleQueue[_Arrival | None] = queue.SimpleQueue()
        self._connections: dict[tuple[str, ...], Any] = {}
        self._is_ended = False
        self._is_time_simulated = False
        self._simulated_time = genpy.Time()

    def end(self) -> None:
        """Makes `run` write the received messages, close the bag, and return.

        Signal handlers may call this method, since it does not take a lock. The method puts an item into the queue that
        `run` reads. Otherwise, the call of `SimpleQueue.get` in `run` might never return: in Python 3.11, `get` may
        block forever if a signal interrupts it shortly before its timeout.
        """
        self._is_ended = True
        self._arrivals.put(None)

    def run(self, topics: Sequence[str]) -> None:
        """Subscribes to topics, and writes their messages until `end` is called.

        Raises:
            OSError: If the bag cannot be written, or the free disk space is too small.
        """
        self._require_space()
        self._is_time_simulated = bool(rospy.get_param("/use_sim_time", False))
        callbacks = {topic: partial(self._on_message, topic) for topic in topics}
        if self._is_time_simulated:
            callbacks[_CLOCK] = partial(self._on_clock, callbacks.get(_CLOCK))
        for topic, callback in callbacks.items():
            rospy.Subscriber(topic, rospy.AnyMsg, callback, queue_size=None, tcp_nodelay=True)
        while not self._now():
            if self._is_ended:
                return
            time.sleep(_POLL_S)
        active = self._path.with_name(f"{self._path.name}.active")
        with rosbag.Bag(str(active), "w", compression="lz4") as bag:
            self._write_all(bag)
        active.rename(self._path)

    def _write_all(self, bag: rosbag.Bag) -> None:
        flushed_s = time.monotonic()
        untimed: list[_Arrival] = []  # received before the first /clock: written with the time of the next message
        while not (self._is_ended and self._arrivals.empty()):
            try:
                arrival = self._arrivals.get(timeout=_POLL_S)
            except queue.Empty:
                arrival = None
            if arrival is not None:
                untimed.append(arrival)
                if arrival.time:
                    for each in untimed:
                        self._write(bag, each, arrival.time)
                    untimed.clear()
            if (now_s := time.monotonic()) - flushed_s > _FLUSH_S:
                flushed_s = now_s
                bag.flush()
                self._require_space()
        for each in untimed:
            self._write(bag, each, self._now())

    def _write(self, bag: rosbag.Bag, arrival: _Arrival, at: genpy.Time) -> None:
        """Writes a message. Each pair of publisher and message type gets a separate connection in the bag."""
        header = arrival.message._connection_header
        key = (arrival.topic, header["md5sum"], header.get("callerid", ""))
        known = bag._topic_connections  # by default, Bag.write has one connection per topic
        known.pop(arrival.topic, None)
        if key in self._connections:
            known[arrival.topic] = self._connections[key]
        described = {"topic": arrival.topic, **{each: header[each] for each in _HEADER if each in header}}
        raw = (
            header["type"],
            bytes(arrival.message._buff),
            header["md5sum"],
            SimpleNamespace(_md5sum=header["md5sum"]),
        )
        bag.write(arrival.topic, raw, at, raw=True, connection_header=described)
        self._connections[key] = known[arrival.topic]

    def _now(self) -> genpy.Time:
        """Returns the ROS time; zero in simulated time before the first /clock message."""
        return self._simulated_time if self._is_time_simulated else rospy.Time.from_sec(time.time())

    def _on_message(self, topic: str, message: rospy.AnyMsg) -> None:
        self._arrivals.put(_Arrival(topic, self._now(), message))

    def _on_clock(self, record: Callable[[rospy.AnyMsg], None] | None, message: rospy.AnyMsg) -> None:
        if message._connection_header["type"] == Clock._type:
            self._simulated_time = Clock().deserialize(message._buff).clock
        if record is not None:
            record(message)

    def _require_space(self) -> None:
        free_mb = shutil.disk_usage(self._path.parent).free / 1e6
        if free_mb < self._min_space_mb:
            raise OSError(f"expected at least {self._min_space_mb:g} MB of free space, got {free_mb:.0f} MB")


def main(words: Sequence[str]) -> int:
    """Records until SIGTERM or SIGINT. Returns the exit code: 0, or 1 if the bag cannot be written.

    Args:
        words: Command-line arguments: node name, path of the bag, minimum free space [MB], and topics.
    """
    parser = argparse.ArgumentParser()
    parser.add_argument("node")
    parser.add_argument("path", type=Path)
    parser.add_argument("min_space_mb", type=float)
    parser.add_argument("topics", nargs="+")
    options = parser.parse_args(words)
    writer = BagWriter(options.path, options.min_space_mb)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: writer.end())
    allow_large_integers()  # counts of received bytes, which the recorder queries, may be large
    rospy.init_node(options.node, argv=[], disable_signals=True, disable_rosout=True, disable_rostime=True)
    try:
        writer.run(options.topics)
    except OSError as error:
        print(f"{NOT_RECORDING}{error}", flush=True)
        return 1
    finally:
        rospy.signal_shutdown("the recording has ended")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
