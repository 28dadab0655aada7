"""Records topics in a separate process that buffers all messages, and reports lost messages."""

from __future__ import annotations

import itertools
import logging
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import rosgraph
from rosgraph.names import get_ros_namespace, resolve_name

from custom_ros_tools.child_process import start_child

from .connected_topics import count_received, count_sent, find_unconnected
from .limits import RecordingError

NOT_RECORDING = "not recording: "
"""Beginning of the line that the recording process prints before it ends with the exit code 1."""
_POLL_S = 0.02
_QUIET_TURNS, _TURN_S, _MOST_GRACE_S = 20, 0.01, 10.0
"""At the end, the recorder has to be idle in this number of checks, with this spacing [s], to let the last messages
arrive. The checks end after `_MOST_GRACE_S` at the latest [s]. A single check could fall into a pause of the machine.
"""
_ACTIVE = ".active"
_DECORATION = re.compile(r"^(\x1b\[[\d;]*m)?\[ *[A-Z]+\] \[[\d., ]+\]: |\x1b\[[\d;]*m", re.MULTILINE)
_numbers = itertools.count()

_log = logging.getLogger(__name__)


class Recorder:
    """Context manager that records all messages published inside the context to a bag with LZ4 compression.

    A separate recording process writes the bag. The recording process buffers all messages until they are
    written, even if it gets no processor time for a while. When the process of the `Recorder` is killed, the recording
    process closes the bag and ends, too.

    On entry, the context waits until the recording process has subscribed to every topic, and is connected to every
    existing publisher. On exit, the context stops the recording process, and waits until the bag is closed. All waiting
    times are wall times.

        with Recorder("out/run.bag", ["/rpbi/kuka/joint_states", "/tf"]):
            ...

    Args:
        path: Path of the bag, ending with `.bag`. Its folder is created, and an existing bag is replaced.
        topics: Topics to record; relative names are resolved in the namespace of this process.
        timeout_s: Longest time to wait for the subscriptions, and for the bag to be closed [s].
        min_space_mb: Free disk space below which the recording ends [MB].
        handles: File descriptors that the recording process inherits, such as the descriptor of a lock.

    Attributes:
        missing: Number of messages that were sent to the recording process before the stop but never arrived.
    """

    def __init__(
        self,
        path: str | Path,
        topics: Sequence[str],
        *,
        timeout_s: float = 30.0,
        min_space_mb: float = 1000.0,
        handles: Collection[int] = (),
    ) -> None:
        self.path = Path(path)
        if self.path.suffix != ".bag":
            raise ValueError(f"the name of a bag ends with '.bag', got '{path}'")
        if isinstance(topics, str) or not topics:
            raise ValueError(f"a list of at least one topic is needed, got {topics!r}")
        self.topics = sorted({resolve_name(topic, get_ros_namespace()) for topic in topics})
        self._timeout_s = timeout_s
        self._min_space_mb = min_space_mb
        self._handles = tuple(handles)
        self.missing = 0
        self._node = f"/recorder_{os.getpid()}_{next(_numbers)}"
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Recorder:
        self.start()
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if error is None:
            self.stop()
            return
        try:
            self.stop()
        except RecordingError as second:  # the first error matters more; Ctrl-C also ends the recorder
            _log.log(logging.INFO if isinstance(error, KeyboardInterrupt) else logging.WARNING, "%s", second)

    @property
    def is_running(self) -> bool:
        """Whether the recording process runs."""
        return self._process is not None and self._process.poll() is None

    def published(self) -> dict[str, int]:
        """Returns how many messages publishers have sent to the recorder so far, indexed by topic.

        Publishers that do not answer are left out. If the master does not answer, the result is empty.
        """
        return count_sent(self._node, self.topics)

    def start(self) -> None:
        """Starts recording. When this method returns, all messages published from then on are recorded.

        Raises:
            RecordingError: If the master cannot be reached, the bag cannot be written, or the recorder ends or
                does not subscribe in time.
        """
        if self.is_running:
            raise RecordingError(self.path, "is going on already")
        if not rosgraph.is_master_online():
            raise RecordingError(self.path, f"no ROS master at {rosgraph.get_master_uri()}")
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.path.unlink(missing_ok=True)  # the old bag must not be mistaken for the new bag
        except OSError as error:
            raise RecordingError(self.path, f"cannot be written: {error}") from None
        self._output = tempfile.TemporaryFile()
        # the recorder closes the bag on SIGTERM; SIGINT is blocked in child processes of nodes
        environment = {key: value for key, value in os.environ.items() if key != "ROS_NAMESPACE"}
        options: dict[str, Any] = {"stdout": self._output, "stderr": subprocess.STDOUT, "env": environment}
        options["pass_fds"] = self._handles
        self._process = start_child(self._command(), signal.SIGTERM, **options)
        try:
            self._wait_until_connected()
        except BaseException:  # Ctrl-C included: leave no process behind
            self._end()
            raise

    def stop(self) -> Path:
        """Stops recording, waits until the bag is complete and closed, and returns the bag's path.

        Raises:
            RecordingError: If the recorder was not started, ended early, could not write, or did not close the bag.
        """
        if self._process is None:
            raise RecordingError(self.path, "has not been started")
        self._wait_until_received()
        self._wait_until_quiet()
        died = not self.is_running
        closed = self._end()
        active = self.path.with_name(self.path.name + _ACTIVE)
        self._raise_if_not_writing()
        if died:
            raise RecordingError(self.path, f"the recorder ended early{self._last_line()}{_what_is_left(active)}")
        if not active.exists() and not self.path.exists():
            raise RecordingError(self.path, "no bag was begun; with use_sim_time the recorder waits for /clock")
        if not closed or active.exists():
            raise RecordingError(self.path, f"the bag was not closed{self._last_line()}{_what_is_left(active)}")
        return self.path

    def _command(self) -> list[str]:
        words = (self._node.removeprefix("/"), str(self.path), str(self._min_space_mb), *self.topics)
        return [sys.executable, "-m", "rpbi_data.bags.bag_writer_node", *words]

    def _wait_until_connected(self) -> None:
        deadline = time.monotonic() + self._timeout_s
        while True:
            if not self.is_running:
                raise RecordingError(self.path, f"the recorder ended at once{self._last_line()}")
            self._raise_if_not_writing()
            try:
                missing, silent = find_unconnected(self._node, self.topics)
            except OSError as error:
                uri = rosgraph.get_master_uri()
                raise RecordingError(self.path, f"the ROS master at {uri} does not answer any more: {error}") from None
            if not missing and not silent:
                return
            if time.monotonic() > deadline:
                break
            time.sleep(_POLL_S)
        if missing:
            raise RecordingError(self.path, f"no subscription to {', '.join(missing)} after {self._timeout_s} s")
        _log.warning("recording %s: not connected to %s", self.path, ", ".join(silent))

    def _wait_until_received(self) -> None:
        """Waits until all messages sent so far have arrived, and sets `missing`.

        Gives up after `_MOST_GRACE_S` without progress, or after `timeout_s` if the recorder never answers. TCP may
        pause for seconds after the recorder got no processor time.
        """
        wanted, last = self.published(), -1
        answer_end = time.monotonic() + self._timeout_s
        deadline = time.monotonic() + _MOST_GRACE_S
        while self.is_running and time.monotonic() < (answer_end if last < 0 else deadline):
            arrived = count_received(self._node)
            if arrived is not None:
                self.missing = sum(max(0, count - arrived.get(topic, 0)) for topic, count in wanted.items())
                if not self.missing:
                    return
                if (total := sum(arrived.values())) > last:
                    last, deadline = total, time.monotonic() + _MOST_GRACE_S
            time.sleep(_POLL_S)
        self.missing = self.missing or sum(wanted.values())

    def _wait_until_quiet(self) -> None:
        assert self._process is not None
        deadline, turns = time.monotonic() + _MOST_GRACE_S, 0
        while self.is_running and turns < _QUIET_TURNS and time.monotonic() < deadline:
            time.sleep(_TURN_S)
            turns += _is_asleep(self._process.pid)

    def _end(self) -> bool:
        """Ends the recording process. Kills it if the bag stops growing before the process has ended.

        Returns:
            Whether the process ended with the exit code 0.
        """
        assert self._process is not None and self._process.stdin is not None
        self._process.send_signal(signal.SIGTERM)
        size = self._written()
        try:
            while True:
                try:
                    return self._process.wait(self._timeout_s) == 0
                except subprocess.TimeoutExpired:
                    if (now := self._written()) == size:
                        self._process.kill()
                        self._process.wait()
                        return False
                    size = now
        finally:
            self._process.stdin.close()

    def _written(self) -> int:
        """Returns the size of the bag that is being written [bytes]; -1 if the bag is closed."""
        try:
            return self.path.with_name(self.path.name + _ACTIVE).stat().st_size
        except OSError:
            return -1

    def _raise_if_not_writing(self) -> None:
        for line in self._lines():
            if line.startswith(NOT_RECORDING):
                raise RecordingError(self.path, line)

    def _last_line(self) -> str:
        lines = self._lines()
        return f": {lines[-1]}" if lines else ""

    def _lines(self) -> list[str]:
        """Returns the lines that the recording process has printed, without log prefixes."""
        file = self._output.fileno()  # `pread` keeps the file position, which the recorder shares
        text = os.pread(file, os.fstat(file).st_size, 0).decode("utf-8", "replace")
        return [line for line in _DECORATION.sub("", text).splitlines() if line.strip()]


def _is_asleep(process_id: int) -> bool:
    """Returns whether all threads of a process wait, so that no thread runs, is runnable or is stopped."""
    try:
        threads = [path.read_text() for path in Path(f"/proc/{process_id}/task").glob("*/stat")]
    except OSError:  # a thread has just ended
        return False
    return all(stat.rpartition(")")[2].split()[0] == "S" for stat in threads)


def _what_is_left(active: Path) -> str:
    return f"; what was recorded can be saved with 'rosbag reindex {active}'" if active.exists() else ""
