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

from robot_model.geometry import Vector

from .link import Link, LoopCommand, LoopInput, LoopReport, Setup

_log = logging.getLogger(__name__)
LOOP = "operator_node.haptics.loop"
"""Program of the loop's process."""
SEND_PERIOD_S = 0.02
"""Longest time between two messages to the loop, repeated if nothing has changed [s]; the loop detects by them that the
node has stopped.
"""
MAX_CLOSE_S = 5.0
STABLE_AFTER_S = 10.0
MAX_FAILURES = 3
"""Number of consecutive processes that end within `STABLE_AFTER_S` after which no further one is started."""


class LoopClient:
    """Keeps a process alive in which the haptic loop runs; any thread may call its methods.

    The process is in a session of its own: a signal to the node's process group leaves it time to send zero force. It
    detects at once when the node has gone, and ends.

    Args:
        setup: First message to the process.
        on_report: Called with each report, in a thread of the client.
        arguments: Further arguments of the process.

    Attributes:
        report: The newest report.
        ended: Set when the device must not be opened again.
        failure: Why the process is not started again; empty unless that is so.
    """

    def __init__(self, setup: Setup, on_report: Callable[[LoopReport], None], arguments: Sequence[str] = ()) -> None:
        self._setup, self._on_report, self._arguments = setup, on_report, arguments
        self._device = setup.device(setup.options)  # never opened here
        self._device.silence()
        self.report, self.failure = LoopReport(), ""
        self.ended = threading.Event()
        self._command, self._lock = setup.command, threading.Lock()
        self._resets = 0
        """Number of requested resets that the loop has done."""
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
        """Opens the device, and again whenever it has gone."""
        with self._lock:
            self._send(self._command._replace(is_on=True, switched=self._command.switched + 1))

    def stop(self) -> None:
        """Sends zero force and closes the device; returns when both are done."""
        with self._lock:
            self._send(self._command._replace(is_on=False, switched=self._command.switched + 1))
            wanted = self._command.switched
        with self._news:
            self._news.wait_for(lambda: self.report.obeyed >= wanted or self.failure, MAX_CLOSE_S)

    def reset(self) -> None:
        """Returns the target to its start."""
        with self._lock:
            self._send(self._command._replace(resets=self._command.resets + 1))

    def observe_wrench(self, force: Vector, delay_s: float) -> None:
        """Sends the force on the tool, in its axes [N], finite."""
        with self._lock:
            self._send(self._command._replace(wrench=LoopInput(force, time.monotonic(), delay_s)))

    def observe_tool(self, displacement: Vector, delay_s: float) -> None:
        """Sends the displacement of the tool from its start, in its axes [m]."""
        with self._lock:
            self._send(self._command._replace(tool=LoopInput(displacement, time.monotonic(), delay_s)))

    def close(self) -> None:
        """Ends the process, after zero force."""
        self.stop()
        with self._lock:
            self._is_closing = True
            self._link.close()
        try:
            self._process.wait(MAX_CLOSE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _send(self, command: LoopCommand) -> None:
        self._command, self._sent_s = command, time.monotonic()
        self._link.send(command)

    def _start(self) -> None:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            program = [sys.executable, "-P", "-m", LOOP, str(theirs.fileno()), *self._arguments]
            self._process = subprocess.Popen(
                program,
                stdin=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
                start_new_session=True,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            )
        self._started_s = time.monotonic()
        self._link = Link(ours)
        self._link.send(self._setup._replace(command=self._command._replace(resets=self._resets)))
        self._send(self._command)

    def _run(self) -> None:
        """Forwards reports, and restarts the process after its end, until the client is closed."""
        failures = 0
        while True:
            self._link.wait(SEND_PERIOD_S)
            if time.monotonic() - self._sent_s > SEND_PERIOD_S:
                with self._lock:
                    self._send(self._command)
            for report in self._link.receive():
                self._resets = report.resets
                self._deliver(report)
            if not self._link.is_closed:
                continue
            if self._is_closing:
                return
            self._device.silence()
            code = self._process.wait()
            how = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
            trouble = f"the process of its loop ended with {how}"
            failures = 0 if time.monotonic() - self._started_s > STABLE_AFTER_S else failures + 1
            if failures >= MAX_FAILURES:
                self.failure = f"{trouble}, {failures} times in a row"
                self._deliver(LoopReport(trouble=self.failure, has_ended=True))
                return
            if self.report.snapshot is not None:
                self._setup = self._setup._replace(displacement=self.report.snapshot.displacement)
            self._deliver(LoopReport(trouble=f"{trouble}, and is started again"))
            with self._lock:
                if self._is_closing:
                    return
                self._start()

    def _deliver(self, report: LoopReport) -> None:
        self.report = report
        try:
            self._on_report(report)
        except Exception:  # the next report is independent of this one
            _log.exception("a report of the haptic loop was lost")
        with self._news:
            self._news.notify_all()
        if report.has_ended:
            self.ended.set()
