"""Scheduling of the simulator's threads and of the renderer process."""

import contextlib
import os
from collections.abc import Callable

from .pacer import Load

NICE = 10
"""Difference of the nice values of a renderer that yields and the simulator, which gets nine times its share."""

REAL_TIME_PRIORITY = 5
"""Priority of the simulator among real-time threads; below 10, that of a haptic loop."""

MOST_SHARE = 0.5
"""Share of a processor up to which real-time scheduling leaves enough for other programs."""


class RealTimePriority:
    """Gives all threads of this process real-time scheduling while its world needs little of a processor.

    On a busy machine a real-time thread runs as soon as it has something to do. Without the permission, scheduling
    stays as it is. Processes that this one starts are scheduled normally.
    """

    def __init__(self) -> None:
        self.acts = False
        """Whether the threads have real-time scheduling."""

    def review(self, load: Load, period_s: float) -> None:
        """Decides again by the processor time of the last second or so, for new threads as well.

        Args:
            load: That processor time.
            period_s: Wall time of a tick [s]; 0 if ticks are made as fast as possible.
        """
        wall_s = min(load.wall_s, load.ticks * period_s) if load.ticks else load.wall_s
        if load.process_s < MOST_SHARE * wall_s:
            _for_all_threads(os.getpid(), self._prefer)
        else:
            self.end()

    def end(self) -> None:
        """Restores normal scheduling."""
        if self.acts:
            self.acts = False
            _for_all_threads(os.getpid(), self._schedule_normally)

    def _prefer(self, thread_id: int) -> None:
        policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(thread_id, policy, os.sched_param(REAL_TIME_PRIORITY))
        self.acts = True

    @staticmethod
    def _schedule_normally(thread_id: int) -> None:
        policy = os.SCHED_OTHER | os.SCHED_RESET_ON_FORK  # only root may reset the flag
        os.sched_setscheduler(thread_id, policy, os.sched_param(0))


def yield_to_simulator() -> None:
    """Gives all threads of this process a lower priority than the simulator has.

    They are batch threads, which interrupt no other one when they wake up. Idle priority would be too low: any process
    of nice 19 would take the processor from the renderer.
    """

    nice = os.getpriority(os.PRIO_PROCESS, 0) + NICE

    def give_way(thread_id: int) -> None:
        os.setpriority(os.PRIO_PROCESS, thread_id, nice)
        os.sched_setscheduler(thread_id, os.SCHED_BATCH, os.sched_param(0))

    _for_all_threads(os.getpid(), give_way)


def run_normally(process_id: int, nice: int) -> None:
    """Gives a process that yields, which may be this one, a nice value again, as far as its user may do that."""

    def set_normal(thread_id: int) -> None:
        os.sched_setscheduler(thread_id, os.SCHED_OTHER, os.sched_param(0))
        os.setpriority(os.PRIO_PROCESS, thread_id, nice)

    _for_all_threads(process_id, set_normal)


def _for_all_threads(process_id: int, change: Callable[[int], None]) -> None:
    """Changes all threads of a process, including those that start meanwhile."""
    changed: set[int] = set()
    while new := _threads(process_id) - changed:
        for thread_id in new:
            with contextlib.suppress(OSError):  # it may have ended, or permission is missing
                change(thread_id)
        changed |= new


def _threads(process_id: int) -> set[int]:
    """Returns the threads of a process, none if it is gone."""
    with contextlib.suppress(OSError):
        return {int(name) for name in os.listdir(f"/proc/{process_id}/task")}
    return set()
