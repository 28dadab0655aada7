"""Runs the 1 kHz loop between a haptic device and its controller, in a separate process.

The haptic node starts the process by `python -m operator_node.haptics.loop FD`, where FD is the file descriptor of a
socket. Further arguments are those of a ROS node, for devices that communicate through ROS.

A separate process is needed because Python runs one thread at a time. In the node's process, a tick would have to wait
for the other threads of the node.
"""

import contextlib
import gc
import logging
import os
import signal
import socket
import sys
import time
from typing import Any

from custom_ros_tools.errors import MissingDependency
from operator_node.device import DeviceError
from robot_model.geometry import ZERO

from .config import HapticNodeConfig
from .controller import HapticController
from .device import DeviceEnded, HapticDevice, ReadingError
from .link import Link, LoopCommand, LoopReport, Setup

_log = logging.getLogger(__name__)
HZ = 1000.0
RETRY_S = 1.0
"""Time between two attempts to open an absent device [s]."""
NODE_SILENCE_S = 0.2
"""Time without messages from the node after which the handle is disengaged [s].

Forces end earlier, because the samples of the tool come from the node and expire.
"""
SWITCH_S = 0.0002
"""Longest time for which a thread of the device may hold Python's lock [s]; Python's default is 5 ms."""


class HapticLoop:
    """Reads the device, runs the controller, and sends the force, at a fixed rate.

    A late tick shifts the following ticks; missed ticks are not repeated. After any failure, the loop sends zero force
    and tries to open the device again.

    Args:
        device: The device. Only the loop may use it.
        controller: Computes forces from readings.
        config: Parameters with the expiry time of forces and the rate of reports.
        link: Connection to the node.
        command: Initial command of the node.
    """

    def __init__(
        self,
        device: HapticDevice,
        controller: HapticController,
        config: HapticNodeConfig,
        link: Link,
        command: LoopCommand = LoopCommand(),  # noqa: B008 (a tuple)
    ) -> None:
        self._device, self._controller, self._link, self._command = device, controller, link, command
        self._expiry_s, self._report_s = config.expiry_s, 1.0 / config.hz
        self._report = LoopReport()
        self._heard_s = self._reported_s = self._retry_at_s = time.monotonic()
        self._samples, self._lateness_s = 0, 0.0

    def run(self) -> None:
        """Keeps the device open while the node requests it. Returns when the connection to the node is closed."""
        _use_real_time_scheduling()
        try:
            self._run()
        finally:
            _use_ordinary_scheduling()

    def _run(self) -> None:
        while not self._link.is_closed:
            self._listen()
            if self._command.switched != self._report.obeyed:
                self._retry_at_s = 0.0
                self._send_report(obeyed=self._command.switched)
            self._send_report_when_due()
            if self._command.is_on and not self._report.has_ended and time.monotonic() >= self._retry_at_s:
                self._use_device()
                self._retry_at_s = time.monotonic() + RETRY_S
            else:
                self._link.wait(self._report_s)

    def _use_device(self) -> None:
        """Opens the device, exchanges readings and forces, and closes the device after a failure or a new command."""
        has_ended = False
        try:
            self._device.open()
            self._send_report(is_connected=True, trouble="")
            self._exchange()
            trouble = "stopped"
        except (DeviceEnded, MissingDependency) as error:
            trouble, has_ended = str(error), True
        except DeviceError as error:
            trouble = str(error)
        except Exception as error:  # user-defined devices may raise any exception; the force must end
            trouble = f"{type(error).__name__}: {error}"
            _log.exception("the device failed")
        self._controller.lose()
        with contextlib.suppress(Exception):  # the device may be absent
            self._device.send(ZERO, time.monotonic())
        self._device.close()
        self._send_report(is_connected=False, trouble=trouble, has_ended=has_ended)

    def _exchange(self) -> None:
        """Runs ticks until the device fails, the node switches the device, or the link is closed."""
        device, controller, period_s = self._device, self._controller, 1.0 / HZ
        due_s = time.monotonic()
        while self._command.switched == self._report.obeyed and not self._link.is_closed:
            now_s = time.monotonic()
            self._listen()
            try:
                reading = device.read()
            except ReadingError as error:
                controller.refuse(error)
                reading = None
            if reading is not None:
                self._samples += 1
            if now_s - self._heard_s > NODE_SILENCE_S:
                reading = None
            device.send(controller.tick(now_s, reading), now_s + self._expiry_s)
            self._send_report_when_due()
            due_s += period_s
            left_s = due_s - time.monotonic()
            if left_s > 0.0:
                time.sleep(left_s)
                self._lateness_s = max(self._lateness_s, time.monotonic() - due_s)
            else:
                self._lateness_s = max(self._lateness_s, -left_s)
                due_s -= left_s

    def _listen(self) -> None:
        """Applies the newest command of the node."""
        command, before, controller = self._link.newest(), self._command, self._controller
        if command is None:
            return
        self._command, self._heard_s = command, time.monotonic()
        if command.resets != before.resets:
            controller.reset()
        if command.wrench is not None and command.wrench != before.wrench:
            controller.observe_wrench(*command.wrench)
        if command.tool is not None and command.tool != before.tool:
            controller.observe_tool(*command.tool)

    def _send_report_when_due(self) -> None:
        if time.monotonic() - self._reported_s >= self._report_s:
            self._send_report()

    def _send_report(self, **changed: Any) -> None:
        """Sends a report to the node, with the given fields of `LoopReport` changed."""
        controller, now_s = self._controller, time.monotonic()
        faults = {**controller.faults, **self._device.faults}
        if controller.not_finite:
            faults["force not finite"] = controller.not_finite
        self._reported_s = max(self._reported_s + self._report_s, now_s - self._report_s)
        self._report = self._report._replace(
            resets=self._report.resets if controller.awaits_reset else self._command.resets,
            samples=self._samples,
            lateness_s=self._lateness_s,
            force=controller.force,
            snapshot=controller.snapshot,
            delay_s=controller.coupling.delay_s(now_s),
            fault=controller.fault,
            faults=faults,
            energy_j=controller.passivity.energy_j,
            energy_bound_j=controller.passivity.floor_j,
            interventions=controller.passivity.interventions,
            **changed,
        )
        if self._link.send(self._report):
            self._lateness_s = 0.0


def _use_real_time_scheduling() -> None:
    """Requests real-time scheduling. Without the permission, scheduling stays unchanged."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))
    except OSError:
        return


def _use_ordinary_scheduling() -> None:
    """Restores ordinary scheduling for all threads of this process.

    While ROS shuts down, a thread of rospy spins until the process has ended. With real-time priority, this thread
    would starve the thread that ends the process, on a machine with one processor.
    """
    for thread in os.listdir("/proc/self/task"):
        with contextlib.suppress(OSError):  # the thread has just ended
            os.sched_setscheduler(int(thread), os.SCHED_OTHER, os.sched_param(0))


def main() -> None:
    """Runs the loop until the node ends or closes the link."""
    link = Link(socket.socket(fileno=int(sys.argv[1])))
    # The node ends this process by closing the link. SIGTERM closes the link, too, so that zero force is sent first
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: link.close())
    link.wait()
    setup: Setup | None = next(link.receive(), None)
    if setup is None:
        return
    sys.setswitchinterval(SWITCH_S)
    device = setup.device(setup.options)
    controller = HapticController(setup.config, setup.options, HZ, setup.displacement)
    gc.collect()
    gc.freeze()  # excludes existing objects from later collections, which become fast
    HapticLoop(device, controller, setup.config, link, setup.command).run()


if __name__ == "__main__":
    main()
