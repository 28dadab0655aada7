"""The node's side of the loop's process."""

from __future__ import annotations

import logging
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence

from rpbi.geometry import Vector

from .link import Link
from .messages import Orders, Report, Setup, Told

_log = logging.getLogger(__name__)
SAY_S = 0.02
"""So often the loop is told something, be it the same again: it notices by that when the node stands still [s]."""
LONGEST_CLOSE_S = 5.0
STABLE_AFTER_S = 10.0
MOST_FAILURES = 3
"""So many processes in a row that end within a moment are not started again."""


class LoopClient:
    """Keeps a process alive in which the haptic loop runs; any thread may call it.

    The process is in a session of its own, so that what ends the node's whole process group leaves it the time to send
    zero; it notices at once when the node has gone, and ends.

    Args:
        setup: What it is told first.
        take: Called with each report, in a thread of the client's.
        arguments: Further arguments of the process.

    Attributes:
        report: The newest report.
        ended: Set when the device is not to be opened again.
        failure: Why the process is not started again; empty unless that is so.
    """

    def __init__(self, setup: Setup, take: Callable[[Report], None], arguments: Sequence[str] = ()) -> None:
        self._setup, self._take, self._arguments = setup, take, arguments
        self._device = setup.device(setup.options)  # never opened here
        self._device.silence()
        self.report, self.failure = Report(), ""
        self.ended = threading.Event()
        self._orders, self._lock = setup.orders, threading.Lock()
        self._resets = 0
        """How many of those that were asked for the loop has done."""
        self._news = threading.Condition()
        self._is_closing = False
        self._start()
        self._thread = threading.Thread(target=self._run, name="haptic loop's reports", daemon=True)
        self._thread.start()

    @property
    def process_id(self) -> int:
        """Id of the loop's process."""
        return self._process.pid

    @property
    def is_real_time(self) -> bool:
        """Whether the process has real-time scheduling, which a system may refuse."""
        try:
            return os.sched_getscheduler(self.process_id) == os.SCHED_FIFO
        except ProcessLookupError:
            return False

    def start(self) -> None:
        """Has the device opened, and again when it has gone."""
        with self._lock:
            self._send(self._orders._replace(is_on=True, switched=self._orders.switched + 1))

    def stop(self) -> None:
        """Has zero force sent and the device closed, and returns when that is done."""
        with self._lock:
            self._send(self._orders._replace(is_on=False, switched=self._orders.switched + 1))
            wanted = self._orders.switched
        with self._news:
            self._news.wait_for(lambda: self.report.obeyed >= wanted or self.failure, LONGEST_CLOSE_S)

    def reset(self) -> None:
        """Has the target go back to its start."""
        with self._lock:
            self._send(self._orders._replace(resets=self._orders.resets + 1))

    def take_wrench(self, force: Vector, delay_s: float) -> None:
        """Takes the force on the tool, in its axes [N], finite."""
        with self._lock:
            self._send(self._orders._replace(wrench=Told(force, time.monotonic(), delay_s)))

    def take_tool(self, way: Vector, delay_s: float) -> None:
        """Takes the way of the tool from where it was at the start, in its axes [m]."""
        with self._lock:
            self._send(self._orders._replace(tool=Told(way, time.monotonic(), delay_s)))

    def close(self) -> None:
        """Ends the process, with zero force before."""
        self.stop()
        with self._lock:
            self._is_closing = True
            self._link.close()
        try:
            self._process.wait(LONGEST_CLOSE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _send(self, orders: Orders) -> None:
        self._orders, self._said_s = orders, time.monotonic()
        self._link.send(orders)

    def _start(self) -> None:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            program = [sys.executable, "-P", "-m", __package__, str(theirs.fileno()), *self._arguments]
            self._process = subprocess.Popen(
                program,
                stdin=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
                start_new_session=True,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            )
        self._started_s = time.monotonic()
        self._link = Link(ours)
        self._link.send(self._setup._replace(orders=self._orders._replace(resets=self._resets)))
        self._send(self._orders)

    def _run(self) -> None:
        """Hands reports on, and starts the process again when it has ended, until the client is closed."""
        failures = 0
        while True:
            self._link.wait(SAY_S)
            if time.monotonic() - self._said_s > SAY_S:
                with self._lock:
                    self._send(self._orders)
            for report in self._link.receive():
                self._resets = report.resets
                self._hand_on(report)
            if not self._link.is_closed:
                continue
            if self._is_closing:
                return
            self._device.silence()
            code = self._process.wait()
            how = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
            trouble = f"the process of its loop ended with {how}"
            failures = 0 if time.monotonic() - self._started_s > STABLE_AFTER_S else failures + 1
            if failures >= MOST_FAILURES:
                self.failure = f"{trouble}, {failures} times in a row"
                self._hand_on(Report(trouble=self.failure, has_ended=True))
                return
            if self.report.snapshot is not None:
                self._setup = self._setup._replace(way=self.report.snapshot.way)
            self._hand_on(Report(trouble=f"{trouble}, and is started again"))
            with self._lock:
                if self._is_closing:
                    return
                self._start()

    def _hand_on(self, report: Report) -> None:
        self.report = report
        try:
            self._take(report)
        except Exception:  # the next report is another
            _log.exception("a report of the haptic loop was lost")
        with self._news:
            self._news.notify_all()
        if report.has_ended:
            self.ended.set()
