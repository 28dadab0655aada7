"""Starts and supervises the process of the haptic loop, on behalf of the haptic node."""

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

from custom_ros_tools.child_process import python_module
from robot_model.geometry import Vector

from .link import Link, LoopCommand, LoopInput, LoopReport, Setup

_log = logging.getLogger(__name__)
LOOP = "operator_node.haptics.loop"
"""Module that the loop's process runs."""
SEND_PERIOD_S = 0.02
"""Longest time between two messages to the loop [s]. Unchanged commands are repeated as a sign of life."""
MAX_CLOSE_S = 5.0
STABLE_AFTER_S = 10.0
MAX_FAILURES = 3
"""Number of consecutive processes ending within `STABLE_AFTER_S` after which the client does not restart the loop."""


class LoopClient:
    """Runs the haptic loop in a separate process, and restarts the process if it ends. The methods are thread-safe.

    The process has its own session. A signal to the node's process group therefore does not reach the process, which
    can still send zero force. The process ends when the node ends.

    Args:
        setup: First message to the process.
        on_report: Function that is called with each report, in a thread of the client.
        arguments: Further command-line arguments of the process.

    Attributes:
        report: The newest report.
        ended: Event that is set when the device must not be opened again.
        failure: Reason why the client no longer restarts the process; empty while the client still restarts it.
    """

    def __init__(self, setup: Setup, on_report: Callable[[LoopReport], None], arguments: Sequence[str] = ()) -> None:
        self._setup, self._on_report, self._arguments = setup, on_report, arguments
        self._device = setup.device(setup.options)  # this instance only sends zero force, and is never opened
        self._device.silence()
        self.report, self.failure = LoopReport(), ""
        self.ended = threading.Event()
        self._command, self._lock = setup.command, threading.Lock()
        self._resets = 0
        """Number of requested resets that the loop has executed."""
        self._news = threading.Condition()
        self._is_closing = False
        self._start()
        self._thread = threading.Thread(target=self._run, name="haptic loop's reports", daemon=True)
        self._thread.start()

    @property
    def process_id(self) -> int:
        """Process id (PID) of the loop's process."""
        return self._process.pid

    @property
    def is_real_time(self) -> bool:
        """Whether the loop's process has real-time scheduling, which the system may refuse."""
        try:
            return os.sched_getscheduler(self.process_id) == os.SCHED_FIFO
        except ProcessLookupError:
            return False

    def start(self) -> None:
        """Requests that the loop opens the device, and opens it again after each disconnection."""
        with self._lock:
            self._send(self._command._replace(is_on=True, switched=self._command.switched + 1))

    def stop(self) -> None:
        """Makes the loop send zero force and close the device. Waits until both are done, for at most `MAX_CLOSE_S`."""
        with self._lock:
            self._send(self._command._replace(is_on=False, switched=self._command.switched + 1))
            wanted = self._command.switched
        with self._news:
            self._news.wait_for(lambda: self.report.obeyed >= wanted or self.failure, MAX_CLOSE_S)

    def reset(self) -> None:
        """Moves the target back to its start."""
        with self._lock:
            self._send(self._command._replace(resets=self._command.resets + 1))

    def observe_wrench(self, force: Vector, delay_s: float) -> None:
        """Sends the force on the tool, finite and in the tool's axes [N], measured `delay_s` [s] ago."""
        with self._lock:
            self._send(self._command._replace(wrench=LoopInput(force, time.monotonic(), delay_s)))

    def observe_tool(self, displacement: Vector, delay_s: float) -> None:
        """Sends the tool's displacement from its start, in the tool's axes [m], measured `delay_s` [s] ago."""
        with self._lock:
            self._send(self._command._replace(tool=LoopInput(displacement, time.monotonic(), delay_s)))

    def close(self) -> None:
        """Makes the loop send zero force, and ends the loop's process."""
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
            program = python_module(LOOP, str(theirs.fileno()), *self._arguments)
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
        """Forwards reports, repeats commands, and restarts the process after its end, until the client is closed."""
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
