"""Scheduling of the renderer process."""

import contextlib
import os
from collections.abc import Callable

NICE = 10
"""Difference of the nice values of a renderer that yields and the simulator, which gets nine times its share."""


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
            with contextlib.suppress(OSError):  # it may be gone, or this not allowed
                change(thread_id)
        changed |= new


def _threads(process_id: int) -> set[int]:
    """Returns the threads of a process, none if it is gone."""
    with contextlib.suppress(OSError):
        return {int(name) for name in os.listdir(f"/proc/{process_id}/task")}
    return set()
