"""A node that runs a control loop in lock-step. Services start and stop the loop, or run a single cycle."""

from __future__ import annotations

import threading
import time
from collections import deque
from pathlib import Path

import rospy
from std_srvs.srv import Trigger, TriggerResponse

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.end_launch import end_launch
from rpbi_mpc.controller import MpcController, Plant
from rpbi_mpc.loop import Cycle, LockStep, LoopConfig, Status
from rpbi_mpc.msg import MpcStatus
from rpbi_mpc.records import write_records

IDLE_S = 0.04
"""Time between two commands to a timed plant while the loop is stopped [s]."""
MAX_MEAN_PERIODS = 1.2
"""Ratio of the mean duration of recent cycles to the period at which a warning is logged, for a timed plant."""
MEAN_CYCLES = 25
"""Number of recent cycles whose durations are averaged."""
WARNING_PERIOD_S = 10.0
"""Least time between two warnings of slow cycles [s]."""
LONG_S = 10.0
"""Time after which the service `mpc/step` warns that it is still waiting for the end of the cycle [s]."""

Answer = tuple[bool, str]


class LoopNode:
    """Runs a control loop in the main thread. The services `mpc/start`, `mpc/stop` and `mpc/step` control the loop.

    The node has three private parameters. If `~start_on_init` is true (default), the loop starts at once. `~out` is the
    folder for the report. If `~end` is true, the node ends together with the task.

    Args:
        plant: The controlled system.
        controller: The controller.
        config: Timing of the loop.
    """

    def __init__(self, plant: Plant, controller: MpcController, config: LoopConfig) -> None:
        self._out = str(rospy.get_param("~out", ""))
        self._ends = bool(rospy.get_param("~end", False))
        self._controller = controller
        self._status = rospy.Publisher("mpc/status", MpcStatus, queue_size=10, latch=True)
        self._changed = threading.Condition()
        self._running, self._steps, self._said = bool(rospy.get_param("~start_on_init", True)), 0, ""
        self._cycles_s: deque[float] = deque(maxlen=MEAN_CYCLES)
        self._loop = LockStep(plant, controller, config, (self._show,))
        for name, action in (("start", self._start), ("stop", self._stop), ("step", self._step)):
            rospy.Service(f"mpc/{name}", Trigger, lambda _, action=action: TriggerResponse(*action()))
        self._status.publish(MpcStatus(status="ready", running=self._running))

    def show(self, cycle: Cycle) -> None:
        """Publishes details of a cycle in addition to `mpc/status`. Does nothing by default."""

    def on_stop(self) -> None:
        """Reacts to the service `mpc/stop`, after the loop has stopped. Does nothing by default."""

    def write_report(self, folder: Path) -> str:
        """Writes the records of all cycles to a folder, and returns a summary in one line.

        Raises:
            OSError: If the folder cannot be written.
        """
        summary = write_records(folder, self._loop.cycles, self._controller)
        return f"{summary['cycles']} cycles"

    def run(self) -> None:
        """Runs the requested cycles until ROS shuts down. If `~end` is true, also returns when the task is done.

        Raises:
            InterfaceError: If the simulator rejects a step, or joint states do not arrive. If `~end` is true, also if
                the loop stops before the task is done.
        """
        while not rospy.is_shutdown():
            if self._is_due():
                start_s = time.monotonic()
                cycle = self._loop.cycle()
                self._cycles_s.append(time.monotonic() - start_s)
                self._warn_if_slow()
                if cycle.status in (Status.FINISHED, Status.STOPPED):
                    self._end()
                    if self._ends and cycle.status == Status.STOPPED:
                        raise InterfaceError(f"the task is not done: {cycle.reason}")
                    if self._ends:
                        end_launch("the task is done")
            elif self._loop.plant.is_timed:
                self._loop.plant.stand()
                self._loop.plant.advance(IDLE_S)

    # --- Services

    def _start(self) -> Answer:
        with self._changed:
            if self._running:
                return False, "the loop is running"
            if self._loop.is_over:
                self._loop.restart()
            self._running = True
            self._changed.notify_all()
        return True, "started"

    def _stop(self) -> Answer:
        with self._changed:
            was_running, self._running = self._running, False
            self.on_stop()
        return was_running, "stopped: the robot stands" if was_running else "the loop is not running"

    def _step(self) -> Answer:
        """Requests a cycle, waits for the cycle's end, and returns success and message of the service."""
        with self._changed:
            if self._running:
                return False, "the loop is running; call mpc/stop first"
            if self._loop.is_over:
                self._loop.restart()
            self._steps += 1
            before = len(self._loop.cycles)
            self._changed.notify_all()
        with self._changed:
            while not self._changed.wait_for(lambda: len(self._loop.cycles) > before, LONG_S):
                if rospy.is_shutdown():
                    return False, "the node ended before the cycle did"
                rospy.logwarn(f"mpc/step: the cycle has not ended within {LONG_S:g} s; waiting")
        cycle = self._loop.cycles[-1]
        return True, f"cycle {cycle.index}: {cycle.status}{cycle.reason and ': '}{cycle.reason}"

    # --- The loop

    def _warn_if_slow(self) -> None:
        mean_s, period_s = sum(self._cycles_s) / len(self._cycles_s), self._loop.config.period_s
        if self._loop.plant.is_timed and len(self._cycles_s) == MEAN_CYCLES and mean_s > MAX_MEAN_PERIODS * period_s:
            text = f"too slow: a cycle takes {1e3 * mean_s:.0f} ms, expected {1e3 * period_s:.0f} ms"
            rospy.logwarn_throttle(WARNING_PERIOD_S, f"{text}; end other programs (docs/slow.md)")

    def _is_due(self) -> bool:
        """Returns True if a cycle is due: if the loop runs, or if a single cycle has been requested.

        If the plant is not timed, waits at most 0.1 s for a request.
        """
        with self._changed:
            if not self._running and not self._steps and not self._loop.plant.is_timed:
                self._changed.wait(0.1)
            if not self._running and not self._steps:
                return False
            self._steps -= not self._running
            return True

    def _show(self, cycle: Cycle) -> None:
        plan = cycle.plan
        text = f"{cycle.status}{cycle.reason and ': '}{cycle.reason}"
        if cycle.status != self._said and cycle.status != Status.SOLVED:
            (rospy.loginfo if cycle.status == Status.FINISHED else rospy.logwarn)(text)
        elif cycle.status == Status.SOLVED and self._said in (Status.WAITING, Status.LAST_PLAN):
            rospy.loginfo("solved: the robot moves again")
        self._said = cycle.status
        message = MpcStatus(cycle=cycle.index, running=self._running, status=str(cycle.status), reason=cycle.reason)
        message.header.stamp = rospy.Time.from_sec(cycle.sensed.time_s)
        message.cost = float("nan") if plan is None else plan.cost
        if plan is not None:
            message.iterations, message.solve_time = plan.iterations, plan.wall_s
            message.processor_time = plan.processor_s
        self._status.publish(message)
        self.show(cycle)
        with self._changed:
            self._changed.notify_all()

    def _end(self) -> None:
        """Stops the plant, and writes the report if `~out` is given."""
        with self._changed:
            self._running = False
        self._loop.plant.stand()
        self._loop.plant.advance(self._loop.config.period_s)
        if not self._out:
            return
        try:
            text = self.write_report(Path(self._out))
        except OSError as error:
            rospy.logerr(f"~out: expected a folder that can be written, got {self._out}: {error.strerror}")
            return
        rospy.loginfo(f"report in {self._out}: {text}")
