"""Scheduling of the renderer process."""

import contextlib
import os


def run_when_idle() -> None:
    """Sets all threads of this process to idle priority, so that physics runs first."""
    for thread_id in _threads(os.getpid()):
        with contextlib.suppress(ProcessLookupError):
            try:
                os.sched_setscheduler(thread_id, os.SCHED_IDLE, os.sched_param(0))
            except PermissionError:  # some containers do not allow it
                os.setpriority(os.PRIO_PROCESS, thread_id, 19)


def run_normally(process_id: int) -> None:
    """Sets an idle process, which may be this one, to normal priority."""
    for thread_id in _threads(process_id):
        with contextlib.suppress(OSError):  # it may be gone, or this not allowed
            os.sched_setscheduler(thread_id, os.SCHED_OTHER, os.sched_param(0))


def raise_from_idle(process_id: int) -> None:
    """Raises an idle process that does not run at all to normal scheduling at nice 19."""
    for thread_id in _threads(process_id):
        with contextlib.suppress(OSError):  # it may be gone, or this not allowed
            os.setpriority(os.PRIO_PROCESS, thread_id, 19)
            os.sched_setscheduler(thread_id, os.SCHED_OTHER, os.sched_param(0))


def _threads(process_id: int) -> list[int]:
    """Returns the threads of a process, none if it is gone."""
    with contextlib.suppress(OSError):
        return [int(name) for name in os.listdir(f"/proc/{process_id}/task")]
    return []
