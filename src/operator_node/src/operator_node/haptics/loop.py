"""The loop between a haptic device and its controller: a thread of its own, at 1 kHz."""

import contextlib
import logging
import os
import sys
import threading
import time
from collections.abc import Callable

from custom_ros_tools.errors import MissingDependency
from operator_node.device import DeviceError

from .controller import HapticController
from .device import DeviceEnded, HapticDevice, ReadingError
from .vectors import ZERO

_log = logging.getLogger(__name__)
HZ = 1000.0
RETRY_S = 1.0
"""After so long a device that is not there is tried again [s]."""
LONGEST_CLOSE_S = 5.0
SWITCH_S = 0.0002
"""How long other threads may keep Python to themselves [s]; Python's default is 5 ms."""


class HapticLoop:
    """Reads the device, asks the controller, and sends the force, by absolute deadlines of the monotonic clock.

    A tick that is late leaves out those that it has missed. Whatever goes wrong, the device is sent zero, and is opened
    again when it is back.

    Args:
        device: The device; it belongs to the loop's thread from now on.
        controller: What turns readings into forces.
        expiry_s: How long a force counts when the loop falls silent [s].
        tell: Called in the loop's thread with one line when the device comes, goes or ends.

    Attributes:
        is_connected: Whether the device is open.
        trouble: Why it is not; empty if it is.
        has_ended: Set when the person is done with the device, or a library is missing.
        samples: How many readings there were.
        lateness_s: The latest that a tick was; whoever reads it may set it to 0 [s].
    """

    def __init__(
        self,
        device: HapticDevice,
        controller: HapticController,
        expiry_s: float,
        tell: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._device, self._controller, self._expiry_s, self._tell = device, controller, expiry_s, tell
        self.is_connected, self.trouble = False, "not opened yet"
        self.has_ended = threading.Event()
        self.samples = 0
        self.lateness_s = 0.0
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begins, also after `stop`."""
        sys.setswitchinterval(SWITCH_S)
        self._stopping.clear()
        self._thread = threading.Thread(target=self._run, name="haptic loop", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Sends zero force, closes the device and returns when that is done."""
        if self._thread is not None:
            self._stopping.set()
            self._thread.join(LONGEST_CLOSE_S)
            self._thread = None

    def _run(self) -> None:
        _prefer_this_thread()
        while not self._stopping.is_set() and not self.has_ended.is_set():
            try:
                self._device.open()
                self.is_connected, self.trouble = True, ""
                self._tell("connected")
                self._exchange()
                trouble = "stopped"
            except (DeviceEnded, MissingDependency) as error:
                trouble = str(error)
                self.has_ended.set()
            except DeviceError as error:
                trouble = str(error)
            except Exception as error:  # of a device of somebody else's: people come before tracebacks
                trouble = f"{type(error).__name__}: {error}"
                _log.exception("the device failed")
            self._close()
            self._lose(trouble)
            if not self.has_ended.is_set():
                self._stopping.wait(RETRY_S)

    def _close(self) -> None:
        """Closes the device, with zero force before."""
        self.is_connected = False
        self._controller.lose()
        with contextlib.suppress(Exception):  # it may have gone, or never been there; closing comes next in any case
            self._device.send(ZERO, time.monotonic())
        self._device.close()

    def _lose(self, trouble: str) -> None:
        if trouble != self.trouble:
            self.trouble = trouble
            self._tell(trouble)

    def _exchange(self) -> None:
        """Ticks until the loop is stopped or the device goes."""
        device, controller, period_s = self._device, self._controller, 1.0 / HZ
        due_s = time.monotonic()
        while not self._stopping.is_set():
            now_s = time.monotonic()
            try:
                reading = device.read()
            except ReadingError as error:
                controller.refuse(error)
                reading = None
            if reading is not None:
                self.samples += 1
            device.send(controller.tick(now_s, reading), now_s + self._expiry_s)
            due_s += period_s
            left_s = due_s - time.monotonic()
            if left_s > 0.0:
                time.sleep(left_s)
                self.lateness_s = max(self.lateness_s, time.monotonic() - due_s)
            else:
                self.lateness_s = max(self.lateness_s, -left_s)
                due_s -= left_s


def _prefer_this_thread() -> None:
    """Asks for real-time scheduling of this thread; without the right to, it goes on as it is."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))
    except OSError:
        return
