"""Sets the scheduling of the simulator's threads and of the renderer process."""

import contextlib
import os
from collections.abc import Callable

from .pacer import Load

NICE = 10
"""Nice value added in a renderer that yields. The simulator then gets nine times as much processor time."""

REAL_TIME_PRIORITY = 5
"""Real-time priority of the simulator's threads, below the priority 10 of a haptic loop."""

MOST_SHARE = 0.5
"""Largest processor use with which the process gets real-time scheduling, as a share of one processor."""


class RealTimePriority:
    """Gives all threads of this process real-time scheduling while the process uses little processor time.

    On a busy machine, a real-time thread runs as soon as it has work. Without permission for real-time scheduling,
    nothing changes. Child processes are scheduled normally.
    """

    def __init__(self) -> None:
        self.acts = False
        """Whether the threads have real-time scheduling."""

    def review(self, load: Load, period_s: float) -> None:
        """Starts or ends real-time scheduling, depending on the recent processor use. Call this about once a second.

        Each call also applies to threads that were started since the last call.

        Args:
            load: Time used since the last call.
            period_s: Wall time of a tick [s]; 0 if ticks are made as fast as possible.
        """
        wall_s = min(load.wall_s, load.ticks * period_s) if load.ticks else load.wall_s
        if load.process_s < MOST_SHARE * wall_s:
            _for_all_threads(os.getpid(), self._prefer)
        else:
            self.end()

    def end(self) -> None:
        """Restores normal scheduling of all threads."""
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
    """Lowers the priority of all threads of this process, a renderer, below the simulator's priority.

    The threads get the batch policy, so they do not preempt other threads when they wake up. The idle policy would be
    too low: any process with nice value 19 would take the processor from the renderer.
    """

    nice = os.getpriority(os.PRIO_PROCESS, 0) + NICE

    def give_way(thread_id: int) -> None:
        os.setpriority(os.PRIO_PROCESS, thread_id, nice)
        os.sched_setscheduler(thread_id, os.SCHED_BATCH, os.sched_param(0))

    _for_all_threads(os.getpid(), give_way)


def run_normally(process_id: int, nice: int) -> None:
    """Restores normal scheduling of a process after `yield_to_simulator`, as far as permissions allow.

    Args:
        process_id: The process, which may be the calling one.
        nice: Nice value to set.
    """

    def set_normal(thread_id: int) -> None:
        os.sched_setscheduler(thread_id, os.SCHED_OTHER, os.sched_param(0))
        os.setpriority(os.PRIO_PROCESS, thread_id, nice)

    _for_all_threads(process_id, set_normal)


def _for_all_threads(process_id: int, change: Callable[[int], None]) -> None:
    """Calls a function for each thread of a process, including threads that start during these calls.

    Args:
        process_id: The process.
        change: Function that is called with a thread id. OSErrors of the function are ignored.
    """
    changed: set[int] = set()
    while new := _threads(process_id) - changed:
        for thread_id in new:
            with contextlib.suppress(OSError):  # it may have ended, or permission is missing
                change(thread_id)
        changed |= new


def _threads(process_id: int) -> set[int]:
    """Returns the ids of a process's threads; empty if the process has ended."""
    with contextlib.suppress(OSError):
        return {int(name) for name in os.listdir(f"/proc/{process_id}/task")}
    return set()
