"""The loop between a haptic device and its controller, at 1 kHz, in a process that does nothing else.

Python runs one thread at a time: beside those of a ROS node a tick would wait for whichever of them has the lock, and
on a busy machine for the moment when that one is given a processor.
"""

import contextlib
import logging
import os
import time
from typing import Any

from custom_ros_tools.errors import MissingDependency
from operator_node.device import DeviceError

from .controller import HapticController
from .device import DeviceEnded, HapticDevice, ReadingError
from .node_config import HapticNodeConfig
from .process.link import Link
from .process.messages import Orders, Report
from .vectors import ZERO

_log = logging.getLogger(__name__)
HZ = 1000.0
RETRY_S = 1.0
"""After so long a device that is not there is tried again [s]."""
NODE_SILENCE_S = 0.2
"""After so long without a word from the node the handle moves nothing, and is engaged anew afterwards [s]. Forces end
before that, since what the tool says comes from the node too."""


class HapticLoop:
    """Reads the device, asks the controller, and sends the force, by absolute deadlines of the monotonic clock.

    A tick that is late leaves out those that it has missed. Whatever goes wrong, the device is sent zero, and is opened
    again when it is back.

    Args:
        device: The device; it belongs to the loop from now on.
        controller: What turns readings into forces.
        config: How long a force counts when the loop falls silent, and how often is reported.
        link: To the node.
        orders: What the node wants so far.
    """

    def __init__(
        self,
        device: HapticDevice,
        controller: HapticController,
        config: HapticNodeConfig,
        link: Link,
        orders: Orders = Orders(),  # noqa: B008 (a tuple)
    ) -> None:
        self._device, self._controller, self._link, self._orders = device, controller, link, orders
        self._expiry_s, self._report_s = config.expiry_s, 1.0 / config.hz
        self._report = Report()
        self._heard_s = self._reported_s = self._retry_at_s = time.monotonic()
        self._samples, self._lateness_s = 0, 0.0

    def run(self) -> None:
        """Has the device open while the node wants it, until the node has gone."""
        _prefer_this_process()
        try:
            self._run()
        finally:
            _prefer_no_longer()

    def _run(self) -> None:
        while not self._link.is_closed:
            self._listen()
            if self._orders.switched != self._report.obeyed:
                self._retry_at_s = 0.0
                self._tell(obeyed=self._orders.switched)
            self._tell_when_due()
            if self._orders.is_on and not self._report.has_ended and time.monotonic() >= self._retry_at_s:
                self._use_device()
                self._retry_at_s = time.monotonic() + RETRY_S
            else:
                self._link.wait(self._report_s)

    def _use_device(self) -> None:
        """Has the device open until it goes, or the node wants otherwise."""
        has_ended = False
        try:
            self._device.open()
            self._tell(is_connected=True, trouble="")
            self._exchange()
            trouble = "stopped"
        except (DeviceEnded, MissingDependency) as error:
            trouble, has_ended = str(error), True
        except DeviceError as error:
            trouble = str(error)
        except Exception as error:  # of a device of somebody else's: people come before tracebacks
            trouble = f"{type(error).__name__}: {error}"
            _log.exception("the device failed")
        self._controller.lose()
        with contextlib.suppress(Exception):  # it may have gone, or never been there; closing comes next in any case
            self._device.send(ZERO, time.monotonic())
        self._device.close()
        self._tell(is_connected=False, trouble=trouble, has_ended=has_ended)

    def _exchange(self) -> None:
        """Ticks until the device goes, or the node wants otherwise."""
        device, controller, period_s = self._device, self._controller, 1.0 / HZ
        due_s = time.monotonic()
        while self._orders.switched == self._report.obeyed and not self._link.is_closed:
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
            self._tell_when_due()
            due_s += period_s
            left_s = due_s - time.monotonic()
            if left_s > 0.0:
                time.sleep(left_s)
                self._lateness_s = max(self._lateness_s, time.monotonic() - due_s)
            else:
                self._lateness_s = max(self._lateness_s, -left_s)
                due_s -= left_s

    def _listen(self) -> None:
        """Takes what the node has said since the last time."""
        orders, before, controller = self._link.newest(), self._orders, self._controller
        if orders is None:
            return
        self._orders, self._heard_s = orders, time.monotonic()
        if orders.resets != before.resets:
            controller.reset()
        if orders.wrench is not None and orders.wrench != before.wrench:
            controller.take_wrench(*orders.wrench)
        if orders.tool is not None and orders.tool != before.tool:
            controller.take_tool(*orders.tool)

    def _tell_when_due(self) -> None:
        if time.monotonic() - self._reported_s >= self._report_s:
            self._tell()

    def _tell(self, **changed: Any) -> None:
        """Reports to the node how things are."""
        controller, now_s = self._controller, time.monotonic()
        faults = {**controller.faults, **self._device.faults}
        if controller.not_finite:
            faults["force not finite"] = controller.not_finite
        self._reported_s = max(self._reported_s + self._report_s, now_s - self._report_s)
        self._report = self._report._replace(
            resets=self._report.resets if controller.awaits_reset else self._orders.resets,
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


def _prefer_this_process() -> None:
    """Asks for real-time scheduling; without the right to, it goes on as it is."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))
    except OSError:
        return


def _prefer_no_longer() -> None:
    """Lets all threads of this process be ordinary ones again.

    While ROS shuts down, a thread of rospy's spins until the process has ended; with a real-time priority it would keep
    the thread that ends it from the only processor.
    """
    for thread in os.listdir("/proc/self/task"):
        with contextlib.suppress(OSError):  # it has just ended
            os.sched_setscheduler(int(thread), os.SCHED_OTHER, os.sched_param(0))
