"""Scheduling of the renderer process."""

import contextlib
import os
from collections.abc import Callable


def run_when_idle() -> None:
    """Sets all threads of this process to idle priority, so that physics runs first."""

    def set_idle(thread_id: int) -> None:
        try:
            os.sched_setscheduler(thread_id, os.SCHED_IDLE, os.sched_param(0))
        except PermissionError:  # some containers do not allow it
            os.setpriority(os.PRIO_PROCESS, thread_id, 19)

    _for_all_threads(os.getpid(), set_idle)


def run_normally(process_id: int) -> None:
    """Sets an idle process, which may be this one, to normal priority."""
    _for_all_threads(process_id, lambda each: os.sched_setscheduler(each, os.SCHED_OTHER, os.sched_param(0)))


def raise_from_idle(process_id: int) -> None:
    """Raises an idle process that does not run at all to normal scheduling at nice 19."""

    def set_nice(thread_id: int) -> None:
        os.setpriority(os.PRIO_PROCESS, thread_id, 19)
        os.sched_setscheduler(thread_id, os.SCHED_OTHER, os.sched_param(0))

    _for_all_threads(process_id, set_nice)


def _for_all_threads(process_id: int, change: Callable[[int], None]) -> None:
    """Changes all threads of a process, including those that start meanwhile."""
    changed: set[int] = set()
    while new := _threads(process_id) - changed:
        for thread_id in new:
            with contextlib.suppress(OSError):  # it may be gone, or this not allowed
                change(thread_id)
        changed |= new


def _threads(process_id: int) -> set[int]:
    """Returns the threads of a process, none if it is gone."""
    with contextlib.suppress(OSError):
        return {int(name) for name in os.listdir(f"/proc/{process_id}/task")}
    return set()
